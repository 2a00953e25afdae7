#pragma once

#include "CoreMinimal.h"
#include "Components/ActorComponent.h"
#include "GraspMotion.h"
#include "GraspComponent.generated.h"

class FJsonObject;
class UPoseableMeshComponent;
class USceneComponent;
class USkeletalMeshComponent;

/** A hand. */
UENUM(BlueprintType)
enum class EGraspHand : uint8
{
	/** The better of both. */
	Either,
	Left,
	Right
};

/** Where the importer of the held object's mesh puts (x, y, z) of the file. */
UENUM(BlueprintType)
enum class EGraspImporter : uint8
{
	/** (x, z, y): Interchange of glTF, FBX. */
	XZY,
	/** (-z, x, y): glTFRuntime. */
	GltfRuntime
};

DECLARE_DYNAMIC_MULTICAST_DELEGATE_ThreeParams(FGraspFound, bool, bFound, const FString&, Type, float, Score);
DECLARE_DYNAMIC_MULTICAST_DELEGATE_ThreeParams(
	FGraspFailed, const FString&, Code, const FString&, Message, const TArray<FString>&, Violations);

/** A character that takes an object out of a person's hand: asks for a grasp, or tracks the holdout, and poses hand and arm. Calls go to
 *  the server's port as JSON (the Connect protocol), by the engine's own HTTP module. */
UCLASS(ClassGroup = (Grasp), meta = (BlueprintSpawnableComponent))
class GRASP_API UGraspComponent : public UActorComponent
{
	GENERATED_BODY()

public:
	UGraspComponent();

	/** The server. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	FString Address = TEXT("http://127.0.0.1:50051");

	/** The object's name on the server. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	FString ObjectName = TEXT("objects/scissors");

	/** The object in the level, with the mesh that was imported from the same file. Its scale is sent. */
	UPROPERTY(BlueprintReadWrite, Category = "Grasp")
	USceneComponent* HeldObject = nullptr;

	/** How that mesh was imported. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	EGraspImporter Importer = EGraspImporter::XZY;

	/** The hand to take it with. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	EGraspHand Hand = EGraspHand::Either;

	/** The rig of the character's hands. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	FString Rig = TEXT("rigs/adult");

	/** While tracking: the hand is closing, and is not sent elsewhere any more. */
	UPROPERTY(BlueprintReadWrite, Category = "Grasp")
	bool bClosing = false;

	/** Ask for grasps that can be sent to other players: GetPacked. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	bool bPacked = false;

	/** How fast the hand goes to the object, in centimeters per second. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	float Speed = 80;

	/** The mesh that is posed and seen: a poseable one with the character's mesh. Unset: only GetJoints tells of the grasp. */
	UPROPERTY(BlueprintReadWrite, Category = "Grasp")
	UPoseableMeshComponent* Posed = nullptr;

	/** The character's animated mesh, hidden; its pose is copied first. Unset: all but the arm stays in the reference pose. */
	UPROPERTY(BlueprintReadWrite, Category = "Grasp")
	USkeletalMeshComponent* Animated = nullptr;

	/** Upper arm, forearm, hand, then three bones of each digit, thumb first. By default those of Unreal's mannequins. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	TArray<FName> LeftBones;

	/** As LeftBones. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = "Grasp")
	TArray<FName> RightBones;

	/** A grasp was found, moved or replaced, or there is none any more. */
	UPROPERTY(BlueprintAssignable, Category = "Grasp")
	FGraspFound OnGrasp;

	/** A call failed. Violations name every wrong field with the allowed values. */
	UPROPERTY(BlueprintAssignable, Category = "Grasp")
	FGraspFailed OnFailed;

	/** Asks once, at the next tick, and plays the motion to the grasp. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	void Ask();

	/** Holds on to a grasp while giver and object move, until Stop. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	void Track();

	/** Lets go: animation takes over, and a track ends. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	void Stop();

	/** The giver's hand as the motion controller component or XR hand tracking has it (HandKeyPositions, HandKeyRotations, HandKeyRadii),
	 *  in the world: 26 joints as in EHandKeypoint. To be called each frame while it is tracked. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	void SetGiver(EGraspHand GiversSide, const TArray<FVector>& Positions, const TArray<FQuat>& Rotations, const TArray<float>& Radii);

	/** Nobody holds the object. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	void ClearGiver();

	/** The last answer's grasp for other players, some 60 bytes; empty without one, or without bPacked. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	TArray<uint8> GetPacked() const { return Packed; }

	/** Shows a grasp that another player sent, of this rig and Importer; needs Posed. False: it cannot be read. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	bool ShowPacked(const TArray<uint8>& Bytes);

	/** The posed hand's 26 joints in the world, as in EHandKeypoint; empty without a grasp. */
	UFUNCTION(BlueprintCallable, Category = "Grasp")
	TArray<FTransform> GetJoints() const;

	virtual void BeginPlay() override;
	virtual void EndPlay(const EEndPlayReason::Type Reason) override;
	virtual void TickComponent(float Seconds, ELevelTick Kind, FActorComponentTickFunction* Function) override;

private:
	using FAnswered = TFunction<void(const FJsonObject&)>;

	/** One hand of the character: its bones at rest, the skeleton that answers pose, and the way from one to the other. */
	struct FHand
	{
		grasp::Arm Rest;
		TOptional<grasp::HandSkeleton> Skeleton;
		TOptional<grasp::ArmPoser> Poser;
	};

	void Call(const TCHAR* Method, const TSharedRef<FJsonObject>& Request, FAnswered Answered);
	void Fail(const FString& Code, const FString& Message, const TArray<FString>& Violations);
	void GetRig();
	void ReadRig(const FJsonObject& Answer);
	void FindGrasp();
	void PushFrame();
	void Tracked(const FJsonObject& Answer, const grasp::Pose& WorldFromObject);
	void Show(const FJsonObject* Grasp, const FJsonObject* Hand, const grasp::Pose& WorldFromObject);
	void Play(std::vector<grasp::Joints> Frames, int32 Next);
	void PoseBones(const grasp::Joints& WorldJoints);
	TSharedRef<FJsonObject> Holdout(bool bWithPoses) const;
	TSharedRef<FJsonObject> Receiver() const;
	TSharedRef<FJsonObject> Output() const;
	const TArray<FName>& BonesOf(int32 Side) const { return Side ? RightBones : LeftBones; }
	bool ReadArm(int32 Side, grasp::Arm& Arm) const;
	grasp::Pose ObjectPose() const;

	/** Left and right. */
	FHand Hands[2];
	TSharedPtr<FJsonObject> Giver;

	/** Answers of calls that were made before the last Stop are dropped. */
	int32 Run = 0;
	bool bAsking = false;
	bool bTracking = false;
	bool bWaiting = false;
	FString TrackName;
	uint64 Sequence = 0;
	double Now = 0;
	double NextTry = 0;

	/** The grasp that is shown, in the object's frame. */
	TOptional<grasp::KeyFramePlayer> Player;
	TOptional<grasp::Joints> Before;
	TOptional<grasp::Vector> Elbow;
	int32 Side = 0;
	double Since = 0;
	TOptional<grasp::Joints> Shown;
	TArray<uint8> Packed;
};
