// Unreal's actors and components, as far as the plugin uses them. The bones of poseable meshes work.

#pragma once

#include "UnrealCore.h"

enum ELevelTick
{
	LEVELTICK_All
};
enum ETickingGroup
{
	TG_PostUpdateWork
};
namespace EEndPlayReason
{
enum Type
{
	Quit
};
}

struct FActorComponentTickFunction
{
	bool bCanEverTick = false;
	ETickingGroup TickGroup{};
};

class UObject
{
};

class UActorComponent : public UObject
{
public:
	using Super = UActorComponent;
	virtual ~UActorComponent() = default;
	virtual void BeginPlay() {}
	virtual void EndPlay(const EEndPlayReason::Type) {}
	virtual void TickComponent(float, ELevelTick, FActorComponentTickFunction*) {}
	FActorComponentTickFunction PrimaryComponentTick;
};

class USceneComponent : public UActorComponent
{
public:
	FTransform Transform;
	const FTransform& GetComponentTransform() const { return Transform; }
};

class AActor : public UObject
{
public:
	using Super = AActor;
	virtual ~AActor() = default;
	virtual void BeginPlay() {}
	USceneComponent* GetRootComponent() { return &Root; }

protected:
	template <class T>
	T* CreateDefaultSubobject(const TCHAR*)
	{
		const auto Made = std::make_shared<T>();
		Components.push_back(Made);
		return Made.get();
	}

private:
	USceneComponent Root;
	std::vector<std::shared_ptr<UActorComponent>> Components;
};

class USkeletalMeshComponent : public USceneComponent
{
};

namespace EBoneSpaces
{
enum Type
{
	WorldSpace
};
}

class UPoseableMeshComponent : public USceneComponent
{
public:
	struct FBone
	{
		std::string Name;
		int32 Parent;
		FTransform Local;
	};
	/** Parents come first. */
	std::vector<FBone> Bones;
	int Copied = 0;
	int32 GetBoneIndex(FName Name) const
	{
		for (std::size_t I = 0; I < Bones.size(); I++)
		{
			if (Bones[I].Name == Name.S)
			{
				return int32(I);
			}
		}
		return INDEX_NONE;
	}
	FTransform World(int32 Bone) const
	{
		return Bone == INDEX_NONE ? Transform : Bones[Bone].Local.In(World(Bones[Bone].Parent));
	}
	FTransform GetBoneTransformByName(FName Name, EBoneSpaces::Type) { return World(GetBoneIndex(Name)); }
	void SetBoneTransformByName(FName Name, const FTransform& To, EBoneSpaces::Type)
	{
		FBone& Bone = Bones.at(GetBoneIndex(Name));
		Bone.Local = To.In(World(Bone.Parent).Inverse());
	}
	void CopyPoseFromSkeletalComponent(USkeletalMeshComponent*) { Copied++; }
};
