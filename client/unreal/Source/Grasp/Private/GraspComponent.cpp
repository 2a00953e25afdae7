#include "GraspComponent.h"

#include "Components/PoseableMeshComponent.h"
#include "Components/SceneComponent.h"
#include "Components/SkeletalMeshComponent.h"
#include "GraspConvert.h"
#include "GraspJson.h"
#include "Misc/Base64.h"

using namespace GraspConvert;

namespace
{
/** Seconds from one grasp to another. */
constexpr double Blend = 0.15;

/** Digits as RigHand.limits names them. */
const TCHAR* const DigitNames[] = {
	TEXT("DIGIT_THUMB"), TEXT("DIGIT_INDEX"), TEXT("DIGIT_MIDDLE"), TEXT("DIGIT_RING"), TEXT("DIGIT_LITTLE")};

/** The bones of Unreal's mannequins. */
TArray<FName> MannequinBones(const TCHAR* Side)
{
	TArray<FName> Bones;
	for (const TCHAR* Bone : {TEXT("upperarm"), TEXT("lowerarm"), TEXT("hand")})
	{
		Bones.Add(FName(*FString::Printf(TEXT("%s_%s"), Bone, Side)));
	}
	for (const TCHAR* Digit : {TEXT("thumb"), TEXT("index"), TEXT("middle"), TEXT("ring"), TEXT("pinky")})
	{
		for (int32 Bone = 1; Bone <= 3; Bone++)
		{
			Bones.Add(FName(*FString::Printf(TEXT("%s_%02d_%s"), Digit, Bone, Side)));
		}
	}
	return Bones;
}
} // namespace

UGraspComponent::UGraspComponent()
{
	PrimaryComponentTick.bCanEverTick = true;
	// After animation.
	PrimaryComponentTick.TickGroup = TG_PostUpdateWork;
	LeftBones = MannequinBones(TEXT("l"));
	RightBones = MannequinBones(TEXT("r"));
}

void UGraspComponent::BeginPlay()
{
	Super::BeginPlay();
	for (int32 Each = 0; Posed && Each < 2; Each++)
	{
		ReadArm(Each, Hands[Each].Rest);
	}
}

void UGraspComponent::EndPlay(const EEndPlayReason::Type Reason)
{
	Stop();
	Super::EndPlay(Reason);
}

void UGraspComponent::Ask()
{
	Stop();
	bAsking = true;
}

void UGraspComponent::FindGrasp()
{
	bAsking = false;
	TSharedRef<FJsonObject> Request = MakeShared<FJsonObject>();
	TSharedRef<FJsonObject> Form = Output();
	Form->SetBoolField(TEXT("keyFrames"), true);
	Request->SetObjectField(TEXT("holdout"), Holdout(true));
	Request->SetObjectField(TEXT("receiver"), Receiver());
	Request->SetObjectField(TEXT("output"), Form);
	const grasp::Pose WorldFromObject = ObjectPose();
	Call(TEXT("GraspService/FindGrasp"), Request, [this, WorldFromObject](const FJsonObject& Answer) {
		const TArray<TSharedPtr<FJsonValue>> Grasps = GraspJson::List(&Answer, TEXT("grasps"));
		const FJsonObject* Grasp = Grasps.Num() > 0 ? Grasps[0]->AsObject().Get() : nullptr;
		Show(Grasp, GraspJson::Object(Grasp, TEXT("hand")), WorldFromObject);
	});
}

void UGraspComponent::Track()
{
	Stop();
	bTracking = true;
}

void UGraspComponent::Stop()
{
	if (!TrackName.IsEmpty())
	{
		TSharedRef<FJsonObject> Request = MakeShared<FJsonObject>();
		Request->SetStringField(TEXT("name"), TrackName);
		Call(TEXT("GraspService/DeleteTrack"), Request, [](const FJsonObject&) {});
	}
	Run++;
	bAsking = false;
	bTracking = false;
	bWaiting = false;
	NextTry = Now;
	TrackName = FString();
	if (Player.IsSet())
	{
		Show(nullptr, nullptr, grasp::Pose());
	}
}

void UGraspComponent::SetGiver(
	EGraspHand GiversSide, const TArray<FVector>& Positions, const TArray<FQuat>& Rotations, const TArray<float>& Radii)
{
	if (Positions.Num() != grasp::JointCount || Rotations.Num() != grasp::JointCount || Radii.Num() != grasp::JointCount)
	{
		OnFailed.Broadcast(TEXT("invalid_argument"), TEXT("the giver's hand needs 26 positions, rotations and radii"), {});
		return;
	}
	TArray<TSharedPtr<FJsonValue>> Joints;
	for (int32 Joint = 0; Joint < grasp::JointCount; Joint++)
	{
		TSharedRef<FJsonObject> Entry = MakeShared<FJsonObject>();
		Entry->SetObjectField(TEXT("pose"), GraspJson::Write(FromUnreal(FTransform(Rotations[Joint], Positions[Joint]))));
		Entry->SetNumberField(TEXT("radius"), Radii[Joint]);
		Joints.Add(MakeShared<FJsonValueObject>(Entry));
	}
	TSharedRef<FJsonObject> HandJoints = MakeShared<FJsonObject>();
	HandJoints->SetStringField(
		TEXT("handedness"), GiversSide == EGraspHand::Left ? TEXT("HANDEDNESS_LEFT") : TEXT("HANDEDNESS_RIGHT"));
	HandJoints->SetArrayField(TEXT("joints"), Joints);
	Giver = MakeShared<FJsonObject>();
	Giver->SetObjectField(TEXT("joints"), HandJoints);
}

void UGraspComponent::ClearGiver()
{
	Giver.Reset();
}

TArray<FTransform> UGraspComponent::GetJoints() const
{
	TArray<FTransform> Transforms;
	if (Shown.IsSet())
	{
		for (const grasp::Pose& Joint : Shown.GetValue())
		{
			Transforms.Add(FTransform(ToUnreal(Joint.Orientation), ToUnreal(Joint.Position)));
		}
	}
	return Transforms;
}

void UGraspComponent::TickComponent(float Seconds, ELevelTick Kind, FActorComponentTickFunction* Function)
{
	Super::TickComponent(Seconds, Kind, Function);
	Now += Seconds;
	if (!bWaiting && Now >= NextTry)
	{
		if (Posed && !Hands[0].Skeleton.IsSet())
		{
			GetRig();
		}
		else if (bAsking)
		{
			FindGrasp();
		}
		else if (bTracking)
		{
			PushFrame();
		}
	}
	if (Posed && Animated)
	{
		Posed->CopyPoseFromSkeletalComponent(Animated);
	}
	Shown.Reset();
	if (Player.IsSet() && HeldObject)
	{
		const double Time = Now - Since;
		grasp::Joints Joints = Player.GetValue().At(Time);
		if (Before.IsSet() && Time < Blend)
		{
			Joints = grasp::Between(Before.GetValue(), Joints, Time / Blend);
		}
		Shown = grasp::Moved(ObjectPose(), Joints);
		PoseBones(Shown.GetValue());
	}
}

void UGraspComponent::GetRig()
{
	TSharedRef<FJsonObject> Request = MakeShared<FJsonObject>();
	Request->SetStringField(TEXT("name"), Rig);
	Call(TEXT("HandRigService/GetRig"), Request, [this](const FJsonObject& Answer) { ReadRig(Answer); });
}

void UGraspComponent::ReadRig(const FJsonObject& Answer)
{
	for (const TSharedPtr<FJsonValue>& Value : GraspJson::List(&Answer, TEXT("hands")))
	{
		const FJsonObject* RigHand = Value->AsObject().Get();
		grasp::HandSkeleton Skeleton;
		Skeleton.bRight = GraspJson::Text(RigHand, TEXT("handedness")) == TEXT("HANDEDNESS_RIGHT");
		Skeleton.Stretched = GraspJson::ReadJoints(GraspJson::List(RigHand, TEXT("stretchedJoints")));
		for (const TSharedPtr<FJsonValue>& Limits : GraspJson::List(RigHand, TEXT("limits")))
		{
			const FJsonObject* Of = Limits->AsObject().Get();
			const FString Digit = GraspJson::Text(Of, TEXT("digit"));
			for (int32 Each = 0; Each < 5; Each++)
			{
				if (Digit == DigitNames[Each])
				{
					Skeleton.Min[Each] = GraspJson::ReadAngles(GraspJson::Object(Of, TEXT("min")));
					Skeleton.Max[Each] = GraspJson::ReadAngles(GraspJson::Object(Of, TEXT("max")));
				}
			}
		}
		FHand& Mine = Hands[Skeleton.bRight ? 1 : 0];
		Mine.Skeleton = Skeleton;
		if (Mine.Rest.Fingers[3] && Mine.Rest.Fingers[6] && Mine.Rest.Fingers[12])
		{
			Mine.Poser = grasp::ArmPoser(Mine.Rest, Skeleton);
		}
	}
}

void UGraspComponent::PushFrame()
{
	TSharedRef<FJsonObject> Request = MakeShared<FJsonObject>();
	if (TrackName.IsEmpty())
	{
		TSharedRef<FJsonObject> Form = Output();
		Form->SetBoolField(TEXT("changesOnly"), true);
		Request->SetObjectField(TEXT("holdout"), Holdout(false));
		Request->SetObjectField(TEXT("receiver"), Receiver());
		Request->SetObjectField(TEXT("output"), Form);
		Call(TEXT("GraspService/CreateTrack"), Request, [this](const FJsonObject& Answer) {
			TrackName = GraspJson::Text(&Answer, TEXT("name"));
		});
		return;
	}
	Sequence++;
	Request->SetStringField(TEXT("track"), TrackName);
	Request->SetStringField(TEXT("sequence"), FString::Printf(TEXT("%llu"), Sequence));
	Request->SetStringField(TEXT("captureTime"), FString::Printf(TEXT("%.6fs"), Now));
	Request->SetBoolField(TEXT("committed"), bClosing);
	Request->SetObjectField(TEXT("holdout"), Holdout(true));
	const grasp::Pose WorldFromObject = ObjectPose();
	Call(TEXT("GraspService/PushFrame"), Request, [this, WorldFromObject](const FJsonObject& Answer) {
		Tracked(Answer, WorldFromObject);
	});
}

void UGraspComponent::Tracked(const FJsonObject& Answer, const grasp::Pose& WorldFromObject)
{
	const FJsonObject* Current = GraspJson::Object(&Answer, TEXT("current"));
	const FJsonObject* Grasp = GraspJson::Object(&Answer, TEXT("grasp"));
	const FString Status = GraspJson::Text(Current, TEXT("status"));
	if (Status == TEXT("CURRENT_GRASP_STATUS_REPLANNED") || Status == TEXT("CURRENT_GRASP_STATUS_ADJUSTED"))
	{
		Show(Grasp, GraspJson::Object(Grasp, TEXT("hand")), WorldFromObject);
	}
	else if (Status == TEXT("CURRENT_GRASP_STATUS_ABORTED"))
	{
		Show(nullptr, GraspJson::Object(Current, TEXT("withdrawal")), WorldFromObject);
	}
	else if (Status == TEXT("CURRENT_GRASP_STATUS_NONE") && Player.IsSet())
	{
		Show(nullptr, nullptr, WorldFromObject);
	}
}

void UGraspComponent::Show(const FJsonObject* Grasp, const FJsonObject* HandPose, const grasp::Pose& WorldFromObject)
{
	Packed.Empty();
	if (HandPose)
	{
		const grasp::Pose ObjectFromWorld = grasp::Inverse(WorldFromObject);
		std::vector<grasp::Joints> Frames;
		const auto Add = [&Frames, &ObjectFromWorld](const FJsonObject* In) {
			Frames.push_back(grasp::Moved(ObjectFromWorld, GraspJson::ReadJoints(GraspJson::List(In, TEXT("joints")))));
		};
		for (const TSharedPtr<FJsonValue>& KeyFrame : GraspJson::List(Grasp, TEXT("keyFrames")))
		{
			Add(GraspJson::Object(KeyFrame->AsObject().Get(), TEXT("hand")));
		}
		if (Frames.empty())
		{
			Add(HandPose);
		}
		Play(std::move(Frames), GraspJson::Text(HandPose, TEXT("handedness")) == TEXT("HANDEDNESS_RIGHT") ? 1 : 0);
		if (const FJsonObject* Arm = GraspJson::Object(Grasp, TEXT("arm")))
		{
			const grasp::Pose World{GraspJson::ReadVector(GraspJson::Object(Arm, TEXT("clientElbow"))), {}};
			Elbow = (ObjectFromWorld * World).Position;
		}
		FBase64::Decode(GraspJson::Text(Grasp, TEXT("packed")), Packed);
	}
	else
	{
		Player.Reset();
	}
	OnGrasp.Broadcast(
		Grasp != nullptr, GraspJson::Text(Grasp, TEXT("type")), static_cast<float>(GraspJson::Number(Grasp, TEXT("score"))));
}

bool UGraspComponent::ShowPacked(const TArray<uint8>& Bytes)
{
	const std::optional<grasp::PackedGrasp> Grasp = grasp::PackedGrasp::Read(Bytes.GetData(), Bytes.Num());
	if (!Grasp || !Hands[Grasp->bRight].Skeleton.IsSet())
	{
		return false;
	}
	const grasp::Joints WristFromJoints = Hands[Grasp->bRight].Skeleton.GetValue().At(Grasp->Angles, Grasp->Scale);
	Play({grasp::Moved(Grasp->ObjectFromWrist, WristFromJoints)}, Grasp->bRight);
	return true;
}

void UGraspComponent::Play(std::vector<grasp::Joints> Frames, int32 Next)
{
	// The hand leaves from where it is, if it is the same one.
	Before.Reset();
	if (Player.IsSet() && Next == Side)
	{
		Before = Player.GetValue().At(Now - Since);
	}
	Elbow.Reset();
	Side = Next;
	Player = grasp::KeyFramePlayer(std::move(Frames), Speed);
	Since = Now;
}

void UGraspComponent::PoseBones(const grasp::Joints& WorldJoints)
{
	grasp::Arm Arm;
	if (!Hands[Side].Poser.IsSet() || !ReadArm(Side, Arm))
	{
		return;
	}
	std::optional<grasp::Vector> Bend;
	if (Elbow.IsSet())
	{
		Bend = (ObjectPose() * grasp::Pose{Elbow.GetValue(), {}}).Position;
	}
	const grasp::ArmTurns Turns = Hands[Side].Poser.GetValue().Turns(Arm, WorldJoints, Bend);
	const auto Turn = [this](int32 Bone, const grasp::Quaternion& Orientation) {
		const FName Name = BonesOf(Side)[Bone];
		if (Posed->GetBoneIndex(Name) != INDEX_NONE)
		{
			FTransform Transform = Posed->GetBoneTransformByName(Name, EBoneSpaces::WorldSpace);
			Transform.SetRotation(ToUnreal(Orientation));
			Posed->SetBoneTransformByName(Name, Transform, EBoneSpaces::WorldSpace);
		}
	};
	Turn(0, Turns.Upper);
	Turn(1, Turns.Forearm);
	Turn(2, Turns.Hand);
	for (int32 Bone = 0; Bone < grasp::FingerBones; Bone++)
	{
		Turn(3 + Bone, Turns.Fingers[Bone]);
	}
}

bool UGraspComponent::ReadArm(int32 Which, grasp::Arm& Arm) const
{
	const TArray<FName>& Names = BonesOf(Which);
	if (Names.Num() != 3 + grasp::FingerBones)
	{
		return false;
	}
	const auto Read = [this](const FName& Name) -> std::optional<grasp::Pose> {
		if (Posed->GetBoneIndex(Name) == INDEX_NONE)
		{
			return std::nullopt;
		}
		return FromUnreal(Posed->GetBoneTransformByName(Name, EBoneSpaces::WorldSpace));
	};
	const std::optional<grasp::Pose> Upper = Read(Names[0]), Forearm = Read(Names[1]), Palm = Read(Names[2]);
	if (!Upper || !Forearm || !Palm)
	{
		return false;
	}
	Arm.Upper = *Upper;
	Arm.Forearm = *Forearm;
	Arm.Hand = *Palm;
	for (int32 Bone = 0; Bone < grasp::FingerBones; Bone++)
	{
		Arm.Fingers[Bone] = Read(Names[3 + Bone]);
	}
	return true;
}

grasp::Pose UGraspComponent::ObjectPose() const
{
	return HeldObject ? FromUnreal(HeldObject->GetComponentTransform()) : grasp::Pose();
}
