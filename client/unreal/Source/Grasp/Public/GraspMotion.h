// Motion to a grasp, and hands and arms of skeletons with bones of their own. Plain C++17, without the engine.

#pragma once

#include "GraspPose.h"

#include <vector>

namespace grasp
{
inline Pose Between(const Pose& From, const Pose& To, double T)
{
	const double Cosine = Dot(From.Orientation, To.Orientation);
	const double Angle = std::acos(std::min(1.0, std::abs(Cosine)));
	double U = 1 - T, V = T;
	if (Angle > 1e-6)
	{
		U = std::sin((1 - T) * Angle) / std::sin(Angle);
		V = std::sin(T * Angle) / std::sin(Angle);
	}
	V = Cosine < 0 ? -V : V;
	const Quaternion &A = From.Orientation, &B = To.Orientation;
	return {
		From.Position * (1 - T) + To.Position * T,
		Normalized({U * A.X + V * B.X, U * A.Y + V * B.Y, U * A.Z + V * B.Z, U * A.W + V * B.W})};
}

/** Between two poses of one hand, T from 0 to 1: bones keep their lengths. */
inline Joints Between(const Joints& From, const Joints& To, double T)
{
	Joints Result;
	Result[Wrist] = Between(From[Wrist], To[Wrist], T);
	for (int Joint = 0; Joint < JointCount; Joint++)
	{
		if (Joint != Wrist)
		{
			const int Root = Parent(Joint);
			Result[Joint] = Result[Root] * Between(Inverse(From[Root]) * From[Joint], Inverse(To[Root]) * To[Joint], T);
		}
	}
	return Result;
}

/** Plays key frames: the open hand, the hand at the object, the grasp. */
class KeyFramePlayer
{
public:
	/** Frames: in the object's frame, so that they follow a moving object; at least one. Speed: of the wrist, in their unit per
	 *  second; fingers close in at least 0.2 s. */
	KeyFramePlayer(std::vector<Joints> InFrames, double Speed) : Frames(std::move(InFrames)), Times(Frames.size())
	{
		for (std::size_t I = 1; I < Frames.size(); I++)
		{
			const double Way = Length(Frames[I][Wrist].Position - Frames[I - 1][Wrist].Position);
			Times[I] = Times[I - 1] + std::max(Way / Speed, 0.2);
		}
	}

	/** The time of the grasp, in seconds from the start. */
	double Duration() const { return Times.back(); }

	/** The joints at a time from the start, in the object's frame. */
	Joints At(double Time) const
	{
		for (std::size_t I = 1; I < Frames.size(); I++)
		{
			if (Time < Times[I])
			{
				return Between(Frames[I - 1], Frames[I], std::max(0.0, (Time - Times[I - 1]) / (Times[I] - Times[I - 1])));
			}
		}
		return Frames.back();
	}

private:
	std::vector<Joints> Frames;
	std::vector<double> Times;
};

/** Number of a hand's bones that bend: three of each digit, thumb first. */
constexpr int FingerBones = 15;

/** The joint of a finger bone. */
inline int JointOf(int Bone) { return BaseJoint[Bone / 3] + Bone % 3; }

/** An arm of a skeleton: the poses of its bones in any one frame. Missing fingers are unset; index, middle and little finger are
 *  required. */
struct Arm
{
	Pose Upper, Forearm, Hand;
	std::array<std::optional<Pose>, FingerBones> Fingers;
};

/** Orientations of an arm's bones, in the order in which they are to be set. */
struct ArmTurns
{
	Quaternion Upper, Forearm, Hand;
	std::array<Quaternion, FingerBones> Fingers;
};

/** Poses an arm whose bones keep their own axes and lengths: fingers point as the joints do, whatever the rest pose is. */
class ArmPoser
{
public:
	/** Rest: the skeleton's reference pose, such as Unreal's A-pose. Skeleton: the hand that answers pose. */
	ArmPoser(const Arm& Rest, const HandSkeleton& Skeleton)
	{
		const Joints Stretched = Skeleton.Rest();
		const Quaternion Mine = Frame(
			Rest.Hand.Position, Rest.Fingers[3]->Position, Rest.Fingers[6]->Position, Rest.Fingers[12]->Position);
		const Quaternion Theirs = Frame(
			Stretched[Wrist].Position, Stretched[7].Position, Stretched[12].Position, Stretched[22].Position);
		const Quaternion RestFromWrist = Mine * Inverse(Theirs);
		const double Ratio = Length(Rest.Fingers[6]->Position - Rest.Hand.Position)
			/ Length(Stretched[12].Position - Stretched[Wrist].Position);
		HandScale = std::min(std::max(std::round(Ratio * 100) / 100, 0.5), 2.0);
		HandAtJoint = Inverse(RestFromWrist) * Rest.Hand.Orientation;
		Quaternion Straight;
		for (int Bone = 0; Bone < FingerBones; Bone++)
		{
			if (!Rest.Fingers[Bone])
			{
				continue;
			}
			const int Joint = JointOf(Bone);
			// The last bone is as straight as the one before it.
			if (Bone % 3 < 2 && Rest.Fingers[Bone + 1])
			{
				Straight = FromTo(
					Rest.Fingers[Bone + 1]->Position - Rest.Fingers[Bone]->Position,
					RestFromWrist * (Stretched[Joint + 1].Position - Stretched[Joint].Position));
			}
			FingerAtJoint[Bone] =
				Inverse(RestFromWrist * Stretched[Joint].Orientation) * Straight * Rest.Fingers[Bone]->Orientation;
		}
	}

	/** The skeleton's hand over the rig's, in hundredths: Receiver.scale. */
	double Scale() const { return HandScale; }

	/** Turns that bring the hand to the joints, as far as the arm reaches.
	 *  Now: the arm as it is, in the joints' frame. Elbow: where it should be, Grasp.arm; unset: it stays in its plane. */
	ArmTurns Turns(const Arm& Now, const Joints& To, const std::optional<Vector>& Elbow) const
	{
		ArmTurns Result;
		Reach(Now, To[Wrist].Position, Elbow.value_or(Now.Forearm.Position), Result);
		Result.Hand = To[Wrist].Orientation * HandAtJoint;
		for (int Bone = 0; Bone < FingerBones; Bone++)
		{
			Result.Fingers[Bone] = To[JointOf(Bone)].Orientation * FingerAtJoint[Bone];
		}
		return Result;
	}

private:
	static Vector Unit(Vector V) { return V * (1 / std::max(Length(V), 1e-9)); }

	static Quaternion FromTo(Vector From, Vector To)
	{
		const Vector A = Unit(From), B = Unit(To);
		if (Dot(A, B) < -0.999999)
		{
			const Vector Any = Unit(Cross(A, std::abs(A.Z) < 0.9 ? Vector{0, 0, 1} : Vector{1, 0, 0}));
			return {Any.X, Any.Y, Any.Z, 0};
		}
		const Vector Axis = Cross(A, B);
		return Normalized({Axis.X, Axis.Y, Axis.Z, 1 + Dot(A, B)});
	}

	/** The frame of a hand whose fingers point along its x, with its z to one side of the palm. */
	static Quaternion Frame(Vector Hand, Vector Index, Vector Middle, Vector Little)
	{
		const Vector X = Unit(Middle - Hand), Z = Unit(Cross(X, Little - Index));
		const Quaternion First = FromTo({1, 0, 0}, X);
		const Vector Side = First * Vector{0, 0, 1};
		const double Angle = std::atan2(Dot(Cross(Side, Z), X), Dot(Side, Z));
		return Quaternion{X.X * std::sin(Angle / 2), X.Y * std::sin(Angle / 2), X.Z * std::sin(Angle / 2), std::cos(Angle / 2)} * First;
	}

	/** Two-bone inverse kinematics. */
	static void Reach(const Arm& Now, Vector Target, Vector Elbow, ArmTurns& Turns)
	{
		const Vector Shoulder = Now.Upper.Position, Before = Now.Forearm.Position;
		const double Upper = Length(Before - Shoulder), Lower = Length(Now.Hand.Position - Before);
		const double Slack = 1e-4 * (Upper + Lower);
		const double Distance =
			std::min(std::max(Length(Target - Shoulder), std::abs(Upper - Lower) + Slack), Upper + Lower - Slack);
		const Vector Along = Unit(Target - Shoulder);
		Vector Aside = Elbow - Shoulder;
		Aside = Aside - Along * Dot(Aside, Along);
		if (Length(Aside) < Slack)
		{
			Aside = Cross(Along, std::abs(Along.Z) < 0.9 ? Vector{0, 0, 1} : Vector{1, 0, 0});
		}
		const double Near = (Upper * Upper - Lower * Lower + Distance * Distance) / (2 * Distance);
		const double Height = std::sqrt(std::max(0.0, Upper * Upper - Near * Near));
		const Vector Bend = Shoulder + Along * Near + Unit(Aside) * Height;
		const Quaternion First = FromTo(Before - Shoulder, Bend - Shoulder);
		Turns.Upper = First * Now.Upper.Orientation;
		const Vector HandNow = First * (Now.Hand.Position - Before);
		Turns.Forearm = FromTo(HandNow, Shoulder + Along * Distance - Bend) * First * Now.Forearm.Orientation;
	}

	double HandScale;
	/** Orientations of bones in the frames of their joints. */
	Quaternion HandAtJoint;
	std::array<Quaternion, FingerBones> FingerAtJoint;
};
} // namespace grasp
