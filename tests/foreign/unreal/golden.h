// Golden grasps, and messages as plain poses.

#pragma once

#include "check.h"

#include "grasp/v1/grasp_service.pb.h"
#include "grasp/v1/hand_rig_service.pb.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <fstream>
#include <sstream>
#include <vector>

namespace v1 = grasp::v1;

struct FGolden
{
	struct FVector
	{
		std::string Name;
		v1::FindGraspRequest Request;
		v1::Grasp OpenXr, Unreal;
		bool IsRight() const { return Unreal.hand().handedness() == v1::HANDEDNESS_RIGHT; }
	};
	std::vector<FVector> Vectors;
	v1::HandRig Rig;

	explicit FGolden(const char* File)
	{
		std::stringstream Text;
		Text << std::ifstream(File).rdbuf();
		google::protobuf::Struct All;
		Check(google::protobuf::util::JsonStringToMessage(Text.str(), &All).ok(), "the golden file is no JSON");
		Rig = Message<v1::HandRig>(All.fields().at("rigs").struct_value().fields().at("rigs/adult"));
		for (const auto& Value : All.fields().at("vectors").list_value().values())
		{
			FVector Vector;
			Vector.Name = Value.struct_value().fields().at("name").string_value();
			for (const auto& One : Value.struct_value().fields().at("conventions").list_value().values())
			{
				const auto& Fields = One.struct_value().fields();
				const std::string Convention = Fields.at("convention").string_value();
				if (Convention == "CONVENTION_OPENXR")
				{
					Vector.OpenXr = Message<v1::FindGraspResponse>(Fields.at("answer")).grasps(0);
				}
				else if (Convention == "CONVENTION_UNREAL")
				{
					Vector.Unreal = Message<v1::FindGraspResponse>(Fields.at("answer")).grasps(0);
					Vector.Request = Message<v1::FindGraspRequest>(Fields.at("request"));
				}
			}
			Vectors.push_back(Vector);
		}
		Check(Vectors.size() == 12, "there are not 12 golden vectors");
	}

	grasp::HandSkeleton Skeleton(bool bRight) const
	{
		const v1::RigHand& Hand = Rig.hands(bRight ? 1 : 0);
		grasp::HandSkeleton Skeleton;
		Skeleton.bRight = bRight;
		for (int Joint = 0; Joint < grasp::JointCount; Joint++)
		{
			Skeleton.Stretched[Joint] = Read(Hand.stretched_joints(Joint).pose());
		}
		for (const v1::DigitLimits& Limits : Hand.limits())
		{
			Skeleton.Min[Limits.digit() - 1] = Read(Limits.min());
			Skeleton.Max[Limits.digit() - 1] = Read(Limits.max());
		}
		return Skeleton;
	}

	static grasp::Vector Read(const v1::Vector3& V) { return {V.x(), V.y(), V.z()}; }
	static grasp::Pose Read(const v1::Pose& P)
	{
		const v1::Quaternion& Q = P.orientation();
		return {Read(P.position()), {Q.x(), Q.y(), Q.z(), Q.w()}};
	}
	static grasp::Angles Read(const v1::DigitAngles& A)
	{
		return {A.base_yaw(), A.base_pitch(), A.second_pitch(), A.has_third_pitch() ? A.third_pitch() : A.second_pitch() * 2 / 3};
	}
	static grasp::Joints Read(const v1::HandPose& Hand)
	{
		grasp::Joints Joints;
		for (int Joint = 0; Joint < grasp::JointCount; Joint++)
		{
			Joints[Joint] = Read(Hand.joints(Joint).pose());
		}
		return Joints;
	}

private:
	template <class T>
	static T Message(const google::protobuf::Value& Value)
	{
		std::string Text;
		T Out;
		Check(google::protobuf::util::MessageToJsonString(Value, &Text).ok(), "a golden value is no JSON");
		const auto Status = google::protobuf::util::JsonStringToMessage(Text, &Out);
		Check(Status.ok(), Status.ToString());
		return Out;
	}
};
