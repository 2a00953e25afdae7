// Tests of the plain headers on the golden grasps, and a client by libgrpc++: client GOLDEN_FILE HOST:PORT.

#include "golden.h"

#include "grasp/v1/grasp_service.grpc.pb.h"

#include <grpcpp/grpcpp.h>

#include <map>
#include <random>

namespace
{
using namespace grasp;

void UnrealsAnswersAreOpenXrsInOtherAxes(const FGolden& Golden)
{
	for (const auto& [Name, Request, OpenXr, Unreal] : Golden.Vectors)
	{
		const auto Same = [&Name = Name](const v1::Pose& A, const v1::Pose& B) {
			Near(PoseToOpenXr(FGolden::Read(A)), FGolden::Read(B), 1e-5, 1e-5, Name);
			Near(FGolden::Read(A), PoseFromOpenXr(FGolden::Read(B)), 1e-3, 1e-5, Name);
		};
		Same(Unreal.hand().client_from_wrist(), OpenXr.hand().client_from_wrist());
		Same(Unreal.hand().object_from_wrist(), OpenXr.hand().object_from_wrist());
		for (int Joint = 0; Joint < JointCount; Joint++)
		{
			Same(Unreal.hand().joints(Joint).pose(), OpenXr.hand().joints(Joint).pose());
		}
		Check(Unreal.contacts_size() == OpenXr.contacts_size(), Name);
		for (int I = 0; I < Unreal.contacts_size(); I++)
		{
			const v1::Contact &A = Unreal.contacts(I), &B = OpenXr.contacts(I);
			Near(PointToOpenXr(FGolden::Read(A.position())), FGolden::Read(B.position()), 1e-5, Name);
			Near(DirectionToOpenXr(FGolden::Read(A.normal())), FGolden::Read(B.normal()), 1e-5, Name);
			Near(DirectionToOpenXr(FGolden::Read(A.force())), FGolden::Read(B.force()), 1e-4, Name);
		}
	}
}

void PackedGraspsAreTheAnswersHands(const FGolden& Golden)
{
	const double HalfDegree = 3.14159265358979 / 360;
	for (const FGolden::FVector& Vector : Golden.Vectors)
	{
		const std::string& Bytes = Vector.Unreal.packed();
		const auto* Data = reinterpret_cast<const uint8_t*>(Bytes.data());
		for (std::size_t Size = 0; Size < Bytes.size(); Size++)
		{
			Check(!PackedGrasp::Read(Data, Size), Vector.Name + ": a part is read");
		}
		const auto Packed = PackedGrasp::Read(Data, Bytes.size());
		Check(Packed.has_value(), Vector.Name + ": cannot be read");
		const v1::HandPose& Hand = Vector.Unreal.hand();
		Check(Packed->Rig == Hand.rig() && Packed->bRight == Vector.IsRight(), Vector.Name + ": another hand");
		Check(Packed->Type == Vector.Unreal.type() && Packed->Convention == v1::CONVENTION_UNREAL, Vector.Name);
		Check(Packed->Scale == 1, Vector.Name + ": another size");
		std::array<bool, 6> Touching{};
		for (const v1::Contact& Contact : Vector.Unreal.contacts())
		{
			Touching[(Contact.digit() + 5) % 6] = true;
		}
		Check(Touching == Packed->Touching, Vector.Name + ": other digits touch");
		const Pose Wrist = FGolden::Read(Hand.object_from_wrist());
		Near(Packed->ObjectFromWrist.Position, Wrist.Position, 0.05, Vector.Name);
		Check(2 * std::acos(std::min(1.0, std::abs(Dot(Packed->ObjectFromWrist.Orientation, Wrist.Orientation)))) < HalfDegree, Vector.Name);
		const v1::DigitAngles* Exact[] = {&Hand.thumb(), &Hand.index(), &Hand.middle(), &Hand.ring(), &Hand.little()};
		for (int Digit = 0; Digit < 5; Digit++)
		{
			for (int I = 0; I < 4; I++)
			{
				Check(std::abs((*Packed->Angles[Digit])[I] - FGolden::Read(*Exact[Digit])[I]) < HalfDegree, Vector.Name);
			}
		}
		const Joints WristFromJoints = Golden.Skeleton(Packed->bRight).At(Packed->Angles, Packed->Scale);
		const Joints Posed = Moved(FGolden::Read(Hand.client_from_wrist()), WristFromJoints);
		const Joints Answer = FGolden::Read(Hand);
		for (int Joint = 0; Joint < JointCount; Joint++)
		{
			Near(Posed[Joint], Answer[Joint], 0.05, 5e-3, Vector.Name + " joint " + std::to_string(Joint));
		}
	}
}

void KeyFramesEndAtTheGraspAndKeepBones(const FGolden& Golden)
{
	const FGolden::FVector& Vector = Golden.Vectors[0];
	const Joints Grasp = FGolden::Read(Vector.Unreal.hand());
	const Pose Back{Grasp[Wrist].Position + grasp::Vector{-10, 0, 0}, Grasp[Wrist].Orientation};
	const Joints Open = Moved(Back, Golden.Skeleton(Vector.IsRight()).Rest());
	const KeyFramePlayer Player({Open, Grasp}, 20);
	Check(std::abs(Player.Duration() - 0.5) < 1e-3, "it takes " + std::to_string(Player.Duration()) + " s");
	Near(Player.At(0)[10], Open[10], 1e-6, 1e-6, "the start");
	Near(Player.At(9)[10], Grasp[10], 1e-6, 1e-6, "the end");
	for (double Time = 0; Time < 0.5; Time += 0.05)
	{
		const Joints Now = Player.At(Time);
		for (int Joint = 0; Joint < JointCount; Joint++)
		{
			const auto Bone = [Joint](const Joints& Of) { return Length(Of[Joint].Position - Of[Parent(Joint)].Position); };
			Check(std::abs(Bone(Now) - Bone(Grasp)) < 0.02, "bone " + std::to_string(Joint) + " changes its length");
		}
	}
}

void AnotherSkeletonsBonesGoToTheJoints(const FGolden& Golden)
{
	std::mt19937 Random(1);
	std::normal_distribution<double> Any;
	const auto Turn = [&] { return Normalized({Any(Random), Any(Random), Any(Random), Any(Random)}); };
	for (const FGolden::FVector& Vector : Golden.Vectors)
	{
		const HandSkeleton Skeleton = Golden.Skeleton(Vector.IsRight());
		// The rig's bones, with axes of their own.
		const Pose Hand{{20, 50, 130}, Turn()};
		const Joints Stretched = Moved(Hand, Skeleton.Rest());
		Arm Rest;
		Rest.Hand = {Hand.Position, Turn()};
		Rest.Forearm = {Hand.Position + Turn() * grasp::Vector{25, 0, 0}, Turn()};
		Rest.Upper = {Rest.Forearm.Position + Turn() * grasp::Vector{30, 0, 0}, Turn()};
		for (int Bone = 0; Bone < FingerBones; Bone++)
		{
			Rest.Fingers[Bone] = Pose{Stretched[JointOf(Bone)].Position, Turn()};
		}
		const grasp::Vector Near1 = Rest.Upper.Position + grasp::Vector{30, 10, -20};
		Joints To = FGolden::Read(Vector.Unreal.hand());
		To = Moved({Near1 - To[Wrist].Position, {}}, To);
		const grasp::Vector Elbow = Rest.Upper.Position + grasp::Vector{-10, 0, -30};
		const ArmTurns Turns = ArmPoser(Rest, Skeleton).Turns(Rest, To, Elbow);
		// Forward through the skeleton: each bone keeps its place in the one before it.
		const auto Child = [](const Pose& RootRest, const Pose& Root, const Pose& Bone, Quaternion Orientation) {
			return Pose{(Root * (Inverse(RootRest) * Bone)).Position, Orientation};
		};
		const Pose Upper{Rest.Upper.Position, Turns.Upper};
		const Pose Forearm = Child(Rest.Upper, Upper, Rest.Forearm, Turns.Forearm);
		const Pose Posed = Child(Rest.Forearm, Forearm, Rest.Hand, Turns.Hand);
		Near(Posed.Position, To[Wrist].Position, 1e-3, Vector.Name + " hand");
		Check(Dot(Forearm.Position - Upper.Position, Elbow - Upper.Position) > 0, Vector.Name + ": the elbow is on the other side");
		Pose Before = Posed, BeforeRest = Rest.Hand;
		for (int Bone = 0; Bone < FingerBones; Bone++)
		{
			if (Bone % 3 == 0)
			{
				Before = Posed;
				BeforeRest = Rest.Hand;
			}
			Before = Child(BeforeRest, Before, *Rest.Fingers[Bone], Turns.Fingers[Bone]);
			BeforeRest = *Rest.Fingers[Bone];
			Near(Before.Position, To[JointOf(Bone)].Position, 1e-3, Vector.Name + " bone " + std::to_string(Bone));
		}
	}
}

void AServerAnswersAGoldenRequestAsBefore(const FGolden& Golden, v1::GraspService::Stub& Service)
{
	const FGolden::FVector& Vector = Golden.Vectors[3];
	grpc::ClientContext Context;
	v1::FindGraspResponse Answer;
	const grpc::Status Status = Service.FindGrasp(&Context, Vector.Request, &Answer);
	Check(Status.ok(), Status.error_message());
	Check(Answer.outcome() == v1::OUTCOME_FOUND, "there is no grasp");
	const Joints Now = FGolden::Read(Answer.grasps(0).hand()), Before = FGolden::Read(Vector.Unreal.hand());
	for (int Joint = 0; Joint < JointCount; Joint++)
	{
		Near(Now[Joint], Before[Joint], 1e-3, 1e-5, "joint " + std::to_string(Joint));
	}
}

void ATrackFollowsTheObject(const FGolden& Golden, v1::GraspService::Stub& Service)
{
	const v1::Holdout& Holdout = Golden.Vectors[3].Request.holdout();
	grpc::ClientContext Context;
	const auto Stream = Service.TrackHoldout(&Context);
	v1::TrackHoldoutRequest First;
	First.mutable_track()->mutable_holdout()->set_object(Holdout.object());
	First.mutable_track()->mutable_search()->mutable_budget()->set_seconds(2);
	First.mutable_track()->mutable_output()->set_convention(v1::CONVENTION_UNREAL);
	Check(Stream->Write(First), "the track is not taken");
	std::map<v1::CurrentGraspStatus, int> Count;
	Pose WorldFromWrist, WorldFromObject;
	for (int Sequence = 1; Sequence <= 30; Sequence++)
	{
		v1::TrackHoldoutRequest Next;
		Next.mutable_frame()->set_sequence(Sequence);
		*Next.mutable_frame()->mutable_holdout() = Holdout;
		Next.mutable_frame()->mutable_holdout()->clear_object();
		// Giver and object move together along y.
		const auto Move = [Sequence](v1::Pose* Of) { Of->mutable_position()->set_y(Of->position().y() + 0.2f * Sequence); };
		Move(Next.mutable_frame()->mutable_holdout()->mutable_client_from_object());
		Move(Next.mutable_frame()->mutable_holdout()->mutable_presenting_hand()->mutable_pose()->mutable_client_from_wrist());
		Check(Stream->Write(Next), "the frame is not taken");
		v1::TrackAnswer Answer;
		Check(Stream->Read(&Answer) && Answer.sequence() == uint64_t(Sequence), "there is no answer");
		Count[Answer.current().status()]++;
		Check(Answer.has_grasp(), "there is no grasp for frame " + std::to_string(Sequence));
		const Pose Object = FGolden::Read(Next.frame().holdout().client_from_object());
		const Pose Wrist = FGolden::Read(Answer.grasp().hand().client_from_wrist());
		if (Answer.current().status() == v1::CURRENT_GRASP_STATUS_KEPT)
		{
			Near(Inverse(Object) * Wrist, Inverse(WorldFromObject) * WorldFromWrist, 1e-3, 1e-5, "the wrist at the object");
		}
		WorldFromObject = Object;
		WorldFromWrist = Wrist;
	}
	Check(Count[v1::CURRENT_GRASP_STATUS_REPLANNED] >= 1 && Count[v1::CURRENT_GRASP_STATUS_KEPT] >= 20, "the grasp is not kept");
	Stream->WritesDone();
	Check(Stream->Finish().ok(), "the stream ends with an error");
}
} // namespace

int main(int, char** Arguments)
{
	const FGolden Golden(Arguments[1]);
	const auto Service = v1::GraspService::NewStub(grpc::CreateChannel(Arguments[2], grpc::InsecureChannelCredentials()));
	return Run("UnrealsAnswersAreOpenXrsInOtherAxes", [&] { UnrealsAnswersAreOpenXrsInOtherAxes(Golden); })
		+ Run("PackedGraspsAreTheAnswersHands", [&] { PackedGraspsAreTheAnswersHands(Golden); })
		+ Run("KeyFramesEndAtTheGraspAndKeepBones", [&] { KeyFramesEndAtTheGraspAndKeepBones(Golden); })
		+ Run("AnotherSkeletonsBonesGoToTheJoints", [&] { AnotherSkeletonsBonesGoToTheJoints(Golden); })
		+ Run("AServerAnswersAGoldenRequestAsBefore", [&] { AServerAnswersAGoldenRequestAsBefore(Golden, *Service); })
		+ Run("ATrackFollowsTheObject", [&] { ATrackFollowsTheObject(Golden, *Service); });
}
