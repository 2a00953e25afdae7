// The calls of the component, and their messages.

#include "Components/SceneComponent.h"
#include "GraspComponent.h"
#include "GraspJson.h"
#include "HttpModule.h"
#include "Interfaces/IHttpRequest.h"
#include "Interfaces/IHttpResponse.h"
#include "Serialization/JsonReader.h"
#include "Serialization/JsonSerializer.h"
#include "Serialization/JsonWriter.h"

DEFINE_LOG_CATEGORY_STATIC(LogGrasp, Log, All);

namespace
{
/** Seconds until a call that failed is tried again. */
constexpr double RetryAfter = 1;

/** Seconds for a call. */
constexpr float Deadline = 10;
} // namespace

void UGraspComponent::Call(const TCHAR* Method, const TSharedRef<FJsonObject>& Request, FAnswered Answered)
{
	FString Body;
	FJsonSerializer::Serialize(Request, TJsonWriterFactory<>::Create(&Body));
	TSharedRef<IHttpRequest, ESPMode::ThreadSafe> Http = FHttpModule::Get().CreateRequest();
	Http->SetURL(FString::Printf(TEXT("%s/grasp.v1.%s"), *Address, Method));
	Http->SetVerb(TEXT("POST"));
	Http->SetHeader(TEXT("Content-Type"), TEXT("application/json"));
	Http->SetHeader(TEXT("Connect-Protocol-Version"), TEXT("1"));
	Http->SetHeader(TEXT("Connect-Timeout-Ms"), FString::Printf(TEXT("%d"), static_cast<int32>(Deadline * 1000)));
	Http->SetTimeout(Deadline + 1);
	Http->SetContentAsString(Body);
	bWaiting = true;
	const int32 Mine = Run;
	Http->OnProcessRequestComplete().BindWeakLambda(
		this, [this, Mine, Answered = MoveTemp(Answered)](FHttpRequestPtr, FHttpResponsePtr Response, bool bConnected) {
			if (Mine != Run)
			{
				return;
			}
			bWaiting = false;
			TSharedPtr<FJsonObject> Answer;
			if (bConnected && Response.IsValid())
			{
				FJsonSerializer::Deserialize(TJsonReaderFactory<>::Create(Response->GetContentAsString()), Answer);
			}
			if (!Answer.IsValid())
			{
				Fail(TEXT("unavailable"), FString::Printf(TEXT("no answer from %s"), *Address), {});
			}
			else if (Response->GetResponseCode() == 200)
			{
				Answered(*Answer);
			}
			else
			{
				TArray<FString> Violations;
				for (const TSharedPtr<FJsonValue>& Detail : GraspJson::List(Answer.Get(), TEXT("details")))
				{
					const FJsonObject* Debug = GraspJson::Object(Detail->AsObject().Get(), TEXT("debug"));
					for (const TSharedPtr<FJsonValue>& Violation : GraspJson::List(Debug, TEXT("fieldViolations")))
					{
						const FJsonObject* Field = Violation->AsObject().Get();
						Violations.Add(
							GraspJson::Text(Field, TEXT("field")) + TEXT(": ") + GraspJson::Text(Field, TEXT("description")));
					}
				}
				Fail(GraspJson::Text(Answer.Get(), TEXT("code")), GraspJson::Text(Answer.Get(), TEXT("message")), Violations);
			}
		});
	Http->ProcessRequest();
}

void UGraspComponent::Fail(const FString& Code, const FString& Message, const TArray<FString>& Violations)
{
	UE_LOG(LogGrasp, Error, TEXT("%s: %s"), *Code, *Message);
	// A server that was restarted has lost the track. A request that is wrong stays wrong.
	TrackName = FString();
	NextTry = Now + RetryAfter;
	bTracking = bTracking && Code != TEXT("invalid_argument");
	OnFailed.Broadcast(Code, Message, Violations);
}

TSharedRef<FJsonObject> UGraspComponent::Holdout(bool bWithPoses) const
{
	TSharedRef<FJsonObject> Out = MakeShared<FJsonObject>();
	Out->SetStringField(TEXT("object"), ObjectName);
	if (bWithPoses)
	{
		Out->SetObjectField(TEXT("clientFromObject"), GraspJson::Write(ObjectPose()));
		if (Giver.IsValid())
		{
			Out->SetObjectField(TEXT("presentingHand"), Giver);
		}
	}
	const double Scale = HeldObject ? HeldObject->GetComponentTransform().GetScale3D().X : 1;
	// Frames of a track take its scale.
	if (TrackName.IsEmpty() && std::abs(Scale - 1) > 0.005)
	{
		Out->SetNumberField(TEXT("scale"), Scale);
	}
	return Out;
}

TSharedRef<FJsonObject> UGraspComponent::Receiver() const
{
	TSharedRef<FJsonObject> Out = MakeShared<FJsonObject>();
	Out->SetStringField(TEXT("rig"), Rig);
	const bool bRight = Hand == EGraspHand::Right;
	const TOptional<grasp::ArmPoser>& Poser = Hands[bRight ? 1 : 0].Poser;
	if (Poser.IsSet())
	{
		Out->SetNumberField(TEXT("scale"), Poser.GetValue().Scale());
	}
	if (Hand == EGraspHand::Either)
	{
		return Out;
	}
	Out->SetStringField(TEXT("handedness"), bRight ? TEXT("HANDEDNESS_RIGHT") : TEXT("HANDEDNESS_LEFT"));
	grasp::Arm Arm;
	if (Posed && ReadArm(bRight ? 1 : 0, Arm))
	{
		Out->SetObjectField(TEXT("clientShoulder"), GraspJson::Write(Arm.Upper.Position));
		Out->SetNumberField(TEXT("upperArmLength"), grasp::Length(Arm.Forearm.Position - Arm.Upper.Position));
		Out->SetNumberField(TEXT("forearmLength"), grasp::Length(Arm.Hand.Position - Arm.Forearm.Position));
	}
	return Out;
}

TSharedRef<FJsonObject> UGraspComponent::Output() const
{
	TSharedRef<FJsonObject> Out = MakeShared<FJsonObject>();
	Out->SetStringField(
		TEXT("convention"), Importer == EGraspImporter::XZY ? TEXT("CONVENTION_UNREAL_XZY") : TEXT("CONVENTION_UNREAL"));
	Out->SetBoolField(TEXT("packed"), bPacked);
	return Out;
}
