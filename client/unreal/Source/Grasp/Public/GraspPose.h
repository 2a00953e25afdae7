// Poses of hands: conventions, packed grasps, forward kinematics. Plain C++17, without the engine.
//
// Joints are in the order of OpenXR and EHandKeypoint: palm, wrist, thumb from 2, fingers from 6, 11, 16 and 21.

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace grasp
{
struct Vector
{
	double X = 0, Y = 0, Z = 0;
};

inline Vector operator+(Vector A, Vector B) { return {A.X + B.X, A.Y + B.Y, A.Z + B.Z}; }
inline Vector operator-(Vector A, Vector B) { return {A.X - B.X, A.Y - B.Y, A.Z - B.Z}; }
inline Vector operator*(Vector A, double Factor) { return {A.X * Factor, A.Y * Factor, A.Z * Factor}; }
inline double Dot(Vector A, Vector B) { return A.X * B.X + A.Y * B.Y + A.Z * B.Z; }
inline double Length(Vector A) { return std::sqrt(Dot(A, A)); }
inline Vector Cross(Vector A, Vector B)
{
	return {A.Y * B.Z - A.Z * B.Y, A.Z * B.X - A.X * B.Z, A.X * B.Y - A.Y * B.X};
}

/** A unit quaternion. Those of Unreal's left-handed axes multiply by the same formulas. */
struct Quaternion
{
	double X = 0, Y = 0, Z = 0, W = 1;
};

inline double Dot(Quaternion A, Quaternion B) { return A.X * B.X + A.Y * B.Y + A.Z * B.Z + A.W * B.W; }
inline Quaternion Inverse(Quaternion Q) { return {-Q.X, -Q.Y, -Q.Z, Q.W}; }
inline Quaternion Normalized(Quaternion Q)
{
	const double Factor = 1 / std::sqrt(Dot(Q, Q));
	return {Q.X * Factor, Q.Y * Factor, Q.Z * Factor, Q.W * Factor};
}

/** Turns by B, then by A. */
inline Quaternion operator*(Quaternion A, Quaternion B)
{
	return {
		A.W * B.X + A.X * B.W + A.Y * B.Z - A.Z * B.Y,
		A.W * B.Y - A.X * B.Z + A.Y * B.W + A.Z * B.X,
		A.W * B.Z + A.X * B.Y - A.Y * B.X + A.Z * B.W,
		A.W * B.W - A.X * B.X - A.Y * B.Y - A.Z * B.Z};
}

inline Vector operator*(Quaternion Q, Vector V)
{
	const Quaternion Turned = Q * Quaternion{V.X, V.Y, V.Z, 0} * Inverse(Q);
	return {Turned.X, Turned.Y, Turned.Z};
}

/** A frame b in a frame a. */
struct Pose
{
	Vector Position;
	Quaternion Orientation;
};

/** a_from_b * b_from_c = a_from_c. */
inline Pose operator*(const Pose& A, const Pose& B)
{
	return {A.Position + A.Orientation * B.Position, A.Orientation * B.Orientation};
}

inline Pose Inverse(const Pose& A)
{
	const Quaternion Turn = Inverse(A.Orientation);
	return {Turn * (A.Position * -1), Turn};
}

constexpr int JointCount = 26;
constexpr int Palm = 0;
constexpr int Wrist = 1;

using Joints = std::array<Pose, JointCount>;

/** The joint at which a digit bends first, thumb first: its metacarpal, or a finger's proximal joint. */
constexpr std::array<int, 5> BaseJoint = {2, 7, 12, 17, 22};

/** The joint before a joint; the wrist for palm, wrist and metacarpals. */
inline int Parent(int Joint) { return Joint < 3 || Joint % 5 == 1 ? Wrist : Joint - 1; }

/** OpenXR's axes (right-handed, +Y up) to Unreal's (left-handed, +Z up, +X forward): directions, forces. */
inline Vector DirectionFromOpenXr(Vector V) { return {-V.Z, V.X, V.Y}; }
inline Vector DirectionToOpenXr(Vector V) { return {V.Y, V.Z, -V.X}; }

/** Points: meters to centimeters. */
inline Vector PointFromOpenXr(Vector V) { return DirectionFromOpenXr(V) * 100; }
inline Vector PointToOpenXr(Vector V) { return DirectionToOpenXr(V) * 0.01; }

inline Pose PoseFromOpenXr(const Pose& P)
{
	const Vector Axis = DirectionFromOpenXr({P.Orientation.X, P.Orientation.Y, P.Orientation.Z});
	return {PointFromOpenXr(P.Position), {Axis.X, Axis.Y, Axis.Z, -P.Orientation.W}};
}

inline Pose PoseToOpenXr(const Pose& P)
{
	const Vector Axis = DirectionToOpenXr({P.Orientation.X, P.Orientation.Y, P.Orientation.Z});
	return {PointToOpenXr(P.Position), {Axis.X, Axis.Y, Axis.Z, -P.Orientation.W}};
}

/** Base yaw, base pitch, second pitch and third pitch of a digit, in radians. */
using Angles = std::array<double, 4>;

/** Angles of each digit, thumb first; unset for one that the hand does not have. */
using Digits = std::array<std::optional<Angles>, 5>;

/** A grasp as a game server passes it on to other players: Grasp.packed of an answer. */
struct PackedGrasp
{
	bool bRight = false;
	/** Digits that touch, thumb first, then the palm. */
	std::array<bool, 6> Touching{};
	/** Number of the GraspType; 0 without one. */
	int Type = 0;
	/** Number of the Convention of ObjectFromWrist. */
	int Convention = 0;
	/** The hand's size over its rig's. */
	double Scale = 1;
	/** The wrist's joint in the object's frame, in the convention's axes and unit. */
	Pose ObjectFromWrist;
	/** Such as "rigs/adult". */
	std::string Rig;
	Digits Angles;

	/** Reads the bytes of Grasp.packed; unset if they are no packed grasp of version 1. */
	static std::optional<PackedGrasp> Read(const uint8_t* Bytes, std::size_t Size)
	{
		constexpr std::size_t Header = 22, DigitBytes = 6;
		if (Size < Header || Bytes[0] != 1)
		{
			return std::nullopt;
		}
		PackedGrasp Grasp;
		std::size_t Count = 0;
		for (int Digit = 0; Digit < 5; Digit++)
		{
			Count += Bytes[1] >> (Digit + 1) & 1;
		}
		std::size_t At = Header + Bytes[21];
		if (Size != At + Count * DigitBytes)
		{
			return std::nullopt;
		}
		Grasp.bRight = Bytes[1] & 1;
		for (int Bit = 0; Bit < 6; Bit++)
		{
			Grasp.Touching[Bit] = Bytes[2] >> Bit & 1;
		}
		Grasp.Type = Bytes[3];
		Grasp.Convention = Bytes[4];
		Grasp.Scale = Bytes[5] / 100.0;
		const auto Short = [Bytes](int Byte) { return static_cast<int16_t>(Bytes[Byte] | Bytes[Byte + 1] << 8); };
		const double Unit = std::ldexp(1.0, static_cast<int8_t>(Bytes[6]));
		Grasp.ObjectFromWrist.Position = {Short(7) * Unit, Short(9) * Unit, Short(11) * Unit};
		Grasp.ObjectFromWrist.Orientation = Normalized(
			{double(Short(13)), double(Short(15)), double(Short(17)), double(Short(19))});
		Grasp.Rig = "rigs/" + std::string(Bytes + Header, Bytes + At);
		const auto Angle = [](int Step) { return (Step - 2048) * Pi / 2048; };
		for (int Digit = 0; Digit < 5; Digit++)
		{
			if (Bytes[1] >> (Digit + 1) & 1)
			{
				const uint8_t* B = Bytes + At;
				Grasp.Angles[Digit] = {
					Angle(B[0] | (B[1] & 15) << 8),
					Angle(B[1] >> 4 | B[2] << 4),
					Angle(B[3] | (B[4] & 15) << 8),
					Angle(B[4] >> 4 | B[5] << 4)};
				At += DigitBytes;
			}
		}
		return Grasp;
	}

private:
	static constexpr double Pi = 3.14159265358979323846;
};

/** The bones of one hand of a rig, as HandRigService.GetRig has them. */
struct HandSkeleton
{
	bool bRight = false;
	/** RigHand.stretched_joints: in OpenXR's axes and meters, in the wrist's frame. */
	Joints Stretched;
	/** RigHand.limits: the smallest and the largest angles. */
	Digits Min, Max;

	/** The stretched hand in Unreal's axes and centimeters, in the wrist's frame. */
	Joints Rest() const { return InUnreal(Stretched, 1); }

	/** The joints at angles, in Unreal's axes and centimeters, in the wrist's frame. Scale: the hand's size over the rig's. */
	Joints At(const Digits& Angles, double Scale) const
	{
		Joints Posed = Stretched;
		for (int Digit = 0; Digit < 5; Digit++)
		{
			if (!Angles[Digit] || !Min[Digit] || !Max[Digit])
			{
				continue;
			}
			const grasp::Angles& Now = *Angles[Digit];
			grasp::Angles Before;
			for (int I = 0; I < 4; I++)
			{
				Before[I] = std::min(std::max(0.0, (*Min[Digit])[I]), (*Max[Digit])[I]);
			}
			const int First = BaseJoint[Digit];
			for (int I = 0; I < 4; I++)
			{
				const int Joint = First + I;
				const Pose Root = I == 0 ? Pose{} : Stretched[Joint - 1];
				Pose Local = Inverse(Root) * Stretched[Joint];
				if (I == 0)
				{
					Local.Orientation = Local.Orientation * Inverse(Bend(Digit, Before[0], Before[1])) * Bend(Digit, Now[0], Now[1]);
				}
				else if (I < 3)
				{
					Local.Orientation = Local.Orientation * About(1, 0, Before[I + 1] - Now[I + 1]);
				}
				Posed[Joint] = (I == 0 ? Pose{} : Posed[Joint - 1]) * Local;
			}
		}
		return InUnreal(Posed, Scale);
	}

private:
	static Quaternion About(double X, double Y, double Angle)
	{
		return {X * std::sin(Angle / 2), Y * std::sin(Angle / 2), 0, std::cos(Angle / 2)};
	}

	/** The turn of a base joint: yaw to the little finger's side, or the thumb's lift, then pitch. */
	Quaternion Bend(int Digit, double Yaw, double Pitch) const
	{
		return About(0, 1, (Digit == 0) == bRight ? Yaw : -Yaw) * About(1, 0, -Pitch);
	}

	static Joints InUnreal(const Joints& OpenXr, double Scale)
	{
		Joints Result;
		for (int Joint = 0; Joint < JointCount; Joint++)
		{
			Result[Joint] = PoseFromOpenXr(OpenXr[Joint]);
			Result[Joint].Position = Result[Joint].Position * Scale;
		}
		return Result;
	}
};

/** Joints given in frame b, in frame a. */
inline Joints Moved(const Pose& AFromB, const Joints& In)
{
	Joints Result;
	std::transform(In.begin(), In.end(), Result.begin(), [&AFromB](const Pose& Joint) { return AFromB * Joint; });
	return Result;
}
} // namespace grasp
