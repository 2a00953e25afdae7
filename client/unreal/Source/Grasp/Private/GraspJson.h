// Between protobuf JSON and plain poses.

#pragma once

#include "CoreMinimal.h"
#include "Dom/JsonObject.h"
#include "Dom/JsonValue.h"
#include "GraspPose.h"

namespace GraspJson
{
using FObject = TSharedPtr<FJsonObject>;

/** A member that is an object; null if it is absent. */
inline const FJsonObject* Object(const FJsonObject* In, const TCHAR* Name)
{
	const FObject* Member = nullptr;
	return In && In->TryGetObjectField(Name, Member) ? Member->Get() : nullptr;
}

/** A member that is a list; empty if it is absent. */
inline TArray<TSharedPtr<FJsonValue>> List(const FJsonObject* In, const TCHAR* Name)
{
	const TArray<TSharedPtr<FJsonValue>>* Member = nullptr;
	return In && In->TryGetArrayField(Name, Member) ? *Member : TArray<TSharedPtr<FJsonValue>>();
}

inline double Number(const FJsonObject* In, const TCHAR* Name, double Absent = 0)
{
	double Value = Absent;
	if (In)
	{
		In->TryGetNumberField(Name, Value);
	}
	return Value;
}

inline FString Text(const FJsonObject* In, const TCHAR* Name)
{
	FString Value;
	if (In)
	{
		In->TryGetStringField(Name, Value);
	}
	return Value;
}

inline grasp::Vector ReadVector(const FJsonObject* In)
{
	return {Number(In, TEXT("x")), Number(In, TEXT("y")), Number(In, TEXT("z"))};
}

inline grasp::Pose ReadPose(const FJsonObject* In)
{
	grasp::Pose Pose;
	Pose.Position = ReadVector(Object(In, TEXT("position")));
	if (const FJsonObject* Q = Object(In, TEXT("orientation")))
	{
		Pose.Orientation = {Number(Q, TEXT("x")), Number(Q, TEXT("y")), Number(Q, TEXT("z")), Number(Q, TEXT("w"))};
	}
	return Pose;
}

/** The poses of a list of joints; those that a hand does not have are the identity. */
inline grasp::Joints ReadJoints(const TArray<TSharedPtr<FJsonValue>>& In)
{
	grasp::Joints Joints;
	for (int32 Joint = 0; Joint < In.Num() && Joint < grasp::JointCount; Joint++)
	{
		Joints[Joint] = ReadPose(Object(In[Joint]->AsObject().Get(), TEXT("pose")));
	}
	return Joints;
}

/** All four of RigHand.limits. */
inline grasp::Angles ReadAngles(const FJsonObject* In)
{
	return {
		Number(In, TEXT("baseYaw")), Number(In, TEXT("basePitch")), Number(In, TEXT("secondPitch")), Number(In, TEXT("thirdPitch"))};
}

inline TSharedRef<FJsonObject> Write(const grasp::Vector& In)
{
	TSharedRef<FJsonObject> Out = MakeShared<FJsonObject>();
	Out->SetNumberField(TEXT("x"), In.X);
	Out->SetNumberField(TEXT("y"), In.Y);
	Out->SetNumberField(TEXT("z"), In.Z);
	return Out;
}

inline TSharedRef<FJsonObject> Write(const grasp::Pose& In)
{
	TSharedRef<FJsonObject> Orientation = Write(grasp::Vector{In.Orientation.X, In.Orientation.Y, In.Orientation.Z});
	Orientation->SetNumberField(TEXT("w"), In.Orientation.W);
	TSharedRef<FJsonObject> Out = MakeShared<FJsonObject>();
	Out->SetObjectField(TEXT("position"), Write(In.Position));
	Out->SetObjectField(TEXT("orientation"), Orientation);
	return Out;
}
} // namespace GraspJson
