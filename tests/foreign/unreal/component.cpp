// Runs the plugin's component with the part of Unreal that it uses: component GOLDEN_FILE http://HOST:PORT.

#include "golden.h"

#include "Components/PoseableMeshComponent.h"
#include "Components/SkeletalMeshComponent.h"
#include "FirstCall.h"
#include "HttpModule.h"

#include <algorithm>

namespace
{
using grasp::Wrist;

constexpr float FrameTime = 1 / 60.0f;

FTransform Transform(const grasp::Pose& P)
{
	return FTransform(
		FQuat(P.Orientation.X, P.Orientation.Y, P.Orientation.Z, P.Orientation.W), FVector(P.Position.X, P.Position.Y, P.Position.Z));
}

/** A component that is to take the remote of a golden request. */
struct FScene
{
	UGraspComponent Component;
	USceneComponent Object;
	UPoseableMeshComponent Posed;
	USkeletalMeshComponent Animated;
	std::vector<std::pair<bool, std::string>> Grasps;
	std::vector<std::pair<FString, TArray<FString>>> Failures;

	FScene(const FGolden& Golden, const FGolden::FVector& Vector, const char* Address)
	{
		Component.Address = Address;
		Component.ObjectName = Vector.Request.holdout().object().c_str();
		Component.Importer = EGraspImporter::GltfRuntime;
		Component.HeldObject = &Object;
		Component.Hand = Vector.IsRight() ? EGraspHand::Right : EGraspHand::Left;
		Object.Transform = Transform(FGolden::Read(Vector.Request.holdout().client_from_object()));
		Component.OnGrasp.Handlers.push_back(
			[this](bool bFound, const FString& Type, float) { Grasps.push_back({bFound, Type.S}); });
		Component.OnFailed.Handlers.push_back(
			[this](const FString& Code, const FString&, const TArray<FString>& Violations) { Failures.push_back({Code, Violations}); });
		Component.Posed = &Posed;
		Component.Animated = &Animated;
		Body(Golden, Vector);
		Component.BeginPlay();
		Frames(3 * FrameTime);
		Check(Failures.empty(), "the rig is not there");
	}

	void Frame()
	{
		Http::Deliver();
		Component.TickComponent(FrameTime, LEVELTICK_All, nullptr);
	}

	void Frames(double Seconds)
	{
		for (double Time = 0; Time < Seconds; Time += FrameTime)
		{
			Frame();
		}
	}

	FTransform Bone(const char* Name) { return Posed.GetBoneTransformByName(FName(Name), EBoneSpaces::WorldSpace); }

private:
	/** Arms with the rig's hands, and metacarpals as Unreal's mannequins have them; shoulders near the object. */
	void Body(const FGolden& Golden, const FGolden::FVector& Vector)
	{
		const grasp::Vector Near = FGolden::Read(Vector.Unreal.hand().client_from_wrist()).Position;
		for (int Side = 0; Side < 2; Side++)
		{
			const grasp::Joints Joints = grasp::Moved({Near + grasp::Vector{-10, 0, 0}, {}}, Golden.Skeleton(Side).Rest());
			const auto& Names = Side ? Component.RightBones : Component.LeftBones;
			const auto Add = [&](const std::string& Name, int Parent, grasp::Vector Position) {
				const FTransform World = Transform({Position, grasp::Normalized({0.1 * double(Posed.Bones.size()), 0.5, -0.3, 1})});
				Posed.Bones.push_back({Name, Parent, World.In(Posed.World(Parent).Inverse())});
				return int(Posed.Bones.size()) - 1;
			};
			const int Upper = Add(Names[0].S, INDEX_NONE, Near + grasp::Vector{-40, 0, 20});
			const int Forearm = Add(Names[1].S, Upper, Near + grasp::Vector{-35, 0, -10});
			const int Hand = Add(Names[2].S, Forearm, Near + grasp::Vector{-10, 0, 0});
			for (int Bone = 0; Bone < grasp::FingerBones; Bone++)
			{
				const int Joint = grasp::JointOf(Bone);
				int Parent = Bone % 3 ? int(Posed.Bones.size()) - 1 : Hand;
				if (Bone % 3 == 0 && Bone > 0)
				{
					Parent = Add("metacarpal", Hand, Joints[Joint - 1].Position);
				}
				Add(Names[3 + Bone].S, Parent, Joints[Joint].Position);
			}
		}
	}
};

const FGolden::FVector& RemoteOf(const FGolden& Golden, bool bRight)
{
	return *std::find_if(Golden.Vectors.begin(), Golden.Vectors.end(), [bRight](const FGolden::FVector& Vector) {
		return Vector.IsRight() == bRight && Vector.Request.holdout().object() == "objects/remote";
	});
}

/** The hand's bones are at the joints of the grasp. */
void CheckBones(FScene& Scene, bool bRight, const std::string& What)
{
	const TArray<FTransform> Joints = Scene.Component.GetJoints();
	Check(Joints.Num() == grasp::JointCount, What + ": there are no joints");
	const auto& Names = bRight ? Scene.Component.RightBones : Scene.Component.LeftBones;
	const auto Off = [&](int Bone, int Joint) {
		const double Distance = (Scene.Bone(Names[Bone].S.c_str()).GetLocation() - Joints[Joint].GetLocation()).Size();
		Check(Distance < 0.1, What + ": " + Names[Bone].S + " is off by " + std::to_string(Distance) + " cm");
	};
	Off(2, Wrist);
	for (int Bone = 0; Bone < grasp::FingerBones; Bone++)
	{
		Off(3 + Bone, grasp::JointOf(Bone));
	}
}

void TheFirstCallOfTheReadmeFindsAGrasp(const FGolden&, const char* Address)
{
	AActor Scissors;
	ATaker Taker;
	Taker.Scissors = &Scissors;
	Taker.Grasp->Address = Address;
	std::string Found;
	Taker.Grasp->OnGrasp.Handlers.push_back([&Found](bool, const FString& Type, float) { Found = Type.S; });
	Taker.BeginPlay();
	Taker.Grasp->TickComponent(FrameTime, LEVELTICK_All, nullptr);
	Http::Deliver();
	Check(Found.find("GRASP_TYPE_") == 0, "it found " + Found);
}

void AComponentAsksOnceAndPosesItsBones(const FGolden& Golden, const char* Address)
{
	for (bool bRight : {true, false})
	{
		const FGolden::FVector& Vector = RemoteOf(Golden, bRight);
		FScene Scene(Golden, Vector, Address);
		Scene.Component.bPacked = true;
		Scene.Component.Ask();
		Scene.Frames(2);
		Check(Scene.Failures.empty() && Scene.Grasps.size() == 1 && Scene.Grasps[0].first, "there is no grasp");
		CheckBones(Scene, bRight, "at the end");
		Check(Scene.Posed.Copied > 100, "the body is not animated");
		Scene.Object.Transform.Location = Scene.Object.Transform.Location + FVector(0, 0, 2);
		Scene.Frame();
		CheckBones(Scene, bRight, "at the object that moved");
		const TArray<FTransform> Before = Scene.Component.GetJoints();
		const TArray<uint8> Packed = Scene.Component.GetPacked();
		Check(Packed.Num() > 50 && Packed.Num() < 128, "there is no packed grasp");
		Scene.Component.Stop();
		Scene.Frame();
		Check(Scene.Component.GetJoints().Num() == 0 && !Scene.Grasps.back().first, "the hand is still there");

		FScene Other(Golden, Vector, Address);
		Other.Object.Transform = Scene.Object.Transform;
		Check(!Other.Component.ShowPacked({1, 2, 3}) && Other.Component.ShowPacked(Packed), "it cannot be read");
		Other.Frames(0.5);
		for (int Joint = 0; Joint < grasp::JointCount; Joint++)
		{
			const double Off = (Other.Component.GetJoints()[Joint].GetLocation() - Before[Joint].GetLocation()).Size();
			Check(Off < 0.05, "the packed hand's joint " + std::to_string(Joint) + " is off by " + std::to_string(Off) + " cm");
		}
		CheckBones(Other, bRight, "of the other player");
	}
}

void AComponentTracksAndEndsItsTrack(const FGolden& Golden, const char* Address)
{
	const FGolden::FVector& Vector = RemoteOf(Golden, true);
	FScene Scene(Golden, Vector, Address);
	// The giver's hand as a headset has it, beside the object.
	TArray<FVector> Positions;
	TArray<FQuat> Rotations;
	TArray<float> Radii;
	const v1::HandPose& Giver = RemoteOf(Golden, false).Unreal.hand();
	for (const v1::JointPose& Joint : Giver.joints())
	{
		const FTransform At = Transform(FGolden::Read(Joint.pose()));
		Positions.Add(At.GetLocation() + FVector(40, 0, 0));
		Rotations.Add(At.GetRotation());
		Radii.Add(Joint.radius());
	}
	Scene.Component.SetGiver(EGraspHand::Left, Positions, Rotations, Radii);
	Scene.Component.Track();
	for (int Frame = 0; Frame < 60 && Scene.Grasps.empty(); Frame++)
	{
		Scene.Frame();
	}
	Check(Scene.Failures.empty() && !Scene.Grasps.empty(), "there is no grasp");
	for (int Frame = 0; Frame < 60; Frame++)
	{
		Scene.Object.Transform.Location = Scene.Object.Transform.Location + FVector(0, 0, 0.1);
		Scene.Frame();
		CheckBones(Scene, true, "frame " + std::to_string(Frame));
	}
	Scene.Component.EndPlay(EEndPlayReason::Quit);
	Http::Deliver();
	Check(Scene.Failures.empty() && Http::Sent().back() == "DeleteTrack", "the track is not ended");
}

void ErrorsNameEveryWrongField(const FGolden& Golden, const char* Address)
{
	FScene Scene(Golden, RemoteOf(Golden, true), Address);
	Scene.Object.Transform.Scale = FVector(9, 9, 9);
	Scene.Component.Ask();
	Scene.Frames(0.1);
	Check(Scene.Failures.size() == 1 && Scene.Failures[0].first == "invalid_argument", "it is no error");
	const TArray<FString>& Violations = Scene.Failures[0].second;
	Check(Violations.Num() == 1 && Violations[0].S.find("holdout.scale: ") == 0, "the field is not named");
	Scene.Component.Address = "http://127.0.0.1:9";
	Scene.Component.Ask();
	Scene.Frames(0.1);
	Check(Scene.Failures.back().first == "unavailable", "it is no error without a server");
}
} // namespace

int main(int, char** Arguments)
{
	const FGolden Golden(Arguments[1]);
	const char* Address = Arguments[2];
	return Run("TheFirstCallOfTheReadmeFindsAGrasp", [&] { TheFirstCallOfTheReadmeFindsAGrasp(Golden, Address); })
		+ Run("AComponentAsksOnceAndPosesItsBones", [&] { AComponentAsksOnceAndPosesItsBones(Golden, Address); })
		+ Run("AComponentTracksAndEndsItsTrack", [&] { AComponentTracksAndEndsItsTrack(Golden, Address); })
		+ Run("ErrorsNameEveryWrongField", [&] { ErrorsNameEveryWrongField(Golden, Address); });
}
