// Between Unreal's types and plain poses. Axes stay as they are.

#pragma once

#include "CoreMinimal.h"
#include "GraspPose.h"

namespace GraspConvert
{
inline FQuat ToUnreal(const grasp::Quaternion& Q) { return FQuat(Q.X, Q.Y, Q.Z, Q.W); }
inline FVector ToUnreal(const grasp::Vector& V) { return FVector(V.X, V.Y, V.Z); }
inline grasp::Vector FromUnreal(const FVector& V) { return {V.X, V.Y, V.Z}; }
inline grasp::Pose FromUnreal(const FTransform& T)
{
	const FQuat Q = T.GetRotation();
	return {FromUnreal(T.GetLocation()), {Q.X, Q.Y, Q.Z, Q.W}};
}
} // namespace GraspConvert
