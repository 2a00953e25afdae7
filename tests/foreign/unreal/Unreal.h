// What the plugin uses of Unreal, with working strings, containers, JSON, HTTP and skeletons. HTTP answers come by Http::Deliver.

#pragma once

#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

using int32 = int32_t;
using uint8 = uint8_t;
using uint64 = unsigned long long;
using TCHAR = char;
#define TEXT(Text) Text
#define GRASP_API
#define UCLASS(...)
#define UENUM(...)
#define UPROPERTY(...)
#define UFUNCTION(...)
#define GENERATED_BODY()
#define INDEX_NONE -1
#define DEFINE_LOG_CATEGORY_STATIC(Name, Level, Compiled)
#define UE_LOG(Category, Level, ...) (std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))
#define IMPLEMENT_MODULE(Class, Module) Class Module##Instance;
#define DECLARE_DYNAMIC_MULTICAST_DELEGATE_ThreeParams(Name, A, NameA, B, NameB, C, NameC) \
	using Name = TMulticast<A, B, C>;

struct FDefaultModuleImpl
{
};

template <class... Arguments>
struct TMulticast
{
	std::vector<std::function<void(Arguments...)>> Handlers;
	template <class T>
	void AddDynamic(T* Object, void (T::*Method)(Arguments...))
	{
		Handlers.push_back([Object, Method](Arguments... Values) { (Object->*Method)(Values...); });
	}
	void Broadcast(Arguments... Values)
	{
		for (const auto& Handler : Handlers)
		{
			Handler(Values...);
		}
	}
};

struct FString
{
	std::string S;
	FString() = default;
	FString(const char* Text) : S(Text) {}
	FString(std::string Text) : S(std::move(Text)) {}
	const char* operator*() const { return S.c_str(); }
	bool IsEmpty() const { return S.empty(); }
	bool operator==(const char* Other) const { return S == Other; }
	bool operator!=(const char* Other) const { return S != Other; }
	bool operator<(const FString& Other) const { return S < Other.S; }
	friend FString operator+(const FString& A, const FString& B) { return FString(A.S + B.S); }
	friend FString operator+(const FString& A, const char* B) { return FString(A.S + B); }
	__attribute__((format(printf, 1, 2))) static FString Printf(const char* Format, ...)
	{
		char Buffer[1024];
		va_list Values;
		va_start(Values, Format);
		std::vsnprintf(Buffer, sizeof Buffer, Format, Values);
		va_end(Values);
		return FString(Buffer);
	}
};

struct FName
{
	std::string S;
	explicit FName(const char* Text) : S(Text) {}
	bool operator<(const FName& Other) const { return S < Other.S; }
};

template <class T>
struct TArray
{
	std::vector<T> V;
	TArray() = default;
	TArray(std::initializer_list<T> Values) : V(Values) {}
	int32 Num() const { return int32(V.size()); }
	void Add(T Value) { V.push_back(std::move(Value)); }
	void Empty() { V.clear(); }
	const T* GetData() const { return V.data(); }
	T& operator[](int32 I) { return V.at(I); }
	const T& operator[](int32 I) const { return V.at(I); }
	auto begin() const { return V.begin(); }
	auto end() const { return V.end(); }
};

template <class T>
struct TOptional
{
	std::optional<T> V;
	TOptional() = default;
	TOptional(const T& Value) : V(Value) {}
	bool IsSet() const { return V.has_value(); }
	T& GetValue() { return V.value(); }
	const T& GetValue() const { return V.value(); }
	void Reset() { V.reset(); }
};

enum class ESPMode
{
	ThreadSafe
};

template <class T, ESPMode Mode = ESPMode::ThreadSafe>
struct TSharedRef
{
	std::shared_ptr<T> P;
	T* operator->() const { return P.get(); }
	T& operator*() const { return *P; }
};

template <class T, ESPMode Mode = ESPMode::ThreadSafe>
struct TSharedPtr
{
	std::shared_ptr<T> P;
	TSharedPtr() = default;
	TSharedPtr(std::nullptr_t) {}
	template <class U>
	TSharedPtr(const TSharedRef<U>& Ref) : P(Ref.P)
	{
	}
	T* Get() const { return P.get(); }
	T* operator->() const { return P.get(); }
	T& operator*() const { return *P; }
	bool IsValid() const { return bool(P); }
	void Reset() { P.reset(); }
};

template <class T, class... Arguments>
TSharedRef<T> MakeShared(Arguments&&... Values)
{
	return {std::make_shared<T>(std::forward<Arguments>(Values)...)};
}

template <class T>
using TFunction = std::function<T>;

template <class T>
std::remove_reference_t<T>&& MoveTemp(T&& Value)
{
	return std::move(Value);
}

struct FVector
{
	double X = 0, Y = 0, Z = 0;
	FVector() = default;
	FVector(double InX, double InY, double InZ) : X(InX), Y(InY), Z(InZ) {}
	FVector operator+(FVector B) const { return {X + B.X, Y + B.Y, Z + B.Z}; }
	FVector operator-(FVector B) const { return {X - B.X, Y - B.Y, Z - B.Z}; }
	double Size() const { return std::sqrt(X * X + Y * Y + Z * Z); }
};

struct FQuat
{
	double X = 0, Y = 0, Z = 0, W = 1;
	FQuat() = default;
	FQuat(double InX, double InY, double InZ, double InW) : X(InX), Y(InY), Z(InZ), W(InW) {}
	FQuat Inverse() const { return {-X, -Y, -Z, W}; }
	FQuat operator*(const FQuat& B) const
	{
		return {
			W * B.X + X * B.W + Y * B.Z - Z * B.Y,
			W * B.Y - X * B.Z + Y * B.W + Z * B.X,
			W * B.Z + X * B.Y - Y * B.X + Z * B.W,
			W * B.W - X * B.X - Y * B.Y - Z * B.Z};
	}
	FVector operator*(const FVector& V) const
	{
		const FQuat Turned = *this * FQuat(V.X, V.Y, V.Z, 0) * Inverse();
		return {Turned.X, Turned.Y, Turned.Z};
	}
};

struct FTransform
{
	FQuat Rotation;
	FVector Location, Scale{1, 1, 1};
	FTransform() = default;
	FTransform(const FQuat& InRotation, const FVector& InLocation) : Rotation(InRotation), Location(InLocation) {}
	const FQuat& GetRotation() const { return Rotation; }
	const FVector& GetLocation() const { return Location; }
	const FVector& GetScale3D() const { return Scale; }
	void SetRotation(const FQuat& Value) { Rotation = Value; }
	/** Root applied to this. */
	FTransform In(const FTransform& Root) const
	{
		return {Root.Rotation * Rotation, Root.Location + Root.Rotation * Location};
	}
	FTransform Inverse() const { return {Rotation.Inverse(), Rotation.Inverse() * (FVector() - Location)}; }
};

// Components.

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

// JSON.

class FJsonObject;

struct FJsonValue
{
	enum EKind
	{
		Null,
		Truth,
		Number,
		Text,
		List,
		Object
	};
	EKind Kind = Null;
	bool bTruth = false;
	double N = 0;
	FString S;
	TArray<TSharedPtr<FJsonValue>> L;
	TSharedPtr<FJsonObject> O;
	const TSharedPtr<FJsonObject>& AsObject() const { return O; }
};

struct FJsonValueObject : FJsonValue
{
	explicit FJsonValueObject(const TSharedPtr<FJsonObject>& Value)
	{
		Kind = Object;
		O = Value;
	}
};

class FJsonObject
{
public:
	std::map<FString, FJsonValue> Fields;
	void SetStringField(const FString& Name, const FString& Value)
	{
		Fields[Name].Kind = FJsonValue::Text;
		Fields[Name].S = Value;
	}
	void SetNumberField(const FString& Name, double Value)
	{
		Fields[Name].Kind = FJsonValue::Number;
		Fields[Name].N = Value;
	}
	void SetBoolField(const FString& Name, bool bValue)
	{
		Fields[Name].Kind = FJsonValue::Truth;
		Fields[Name].bTruth = bValue;
	}
	void SetObjectField(const FString& Name, const TSharedPtr<FJsonObject>& Value)
	{
		Fields[Name].Kind = FJsonValue::Object;
		Fields[Name].O = Value;
	}
	void SetArrayField(const FString& Name, const TArray<TSharedPtr<FJsonValue>>& Value)
	{
		Fields[Name].Kind = FJsonValue::List;
		Fields[Name].L = Value;
	}
	const FJsonValue* Find(const FString& Name, FJsonValue::EKind Kind) const
	{
		const auto Found = Fields.find(Name);
		return Found != Fields.end() && Found->second.Kind == Kind ? &Found->second : nullptr;
	}
	bool TryGetStringField(const FString& Name, FString& Out) const
	{
		const FJsonValue* Value = Find(Name, FJsonValue::Text);
		return Value && (Out = Value->S, true);
	}
	bool TryGetNumberField(const FString& Name, double& Out) const
	{
		const FJsonValue* Value = Find(Name, FJsonValue::Number);
		return Value && (Out = Value->N, true);
	}
	bool TryGetObjectField(const FString& Name, const TSharedPtr<FJsonObject>*& Out) const
	{
		const FJsonValue* Value = Find(Name, FJsonValue::Object);
		return Value && (Out = &Value->O, true);
	}
	bool TryGetArrayField(const FString& Name, const TArray<TSharedPtr<FJsonValue>>*& Out) const
	{
		const FJsonValue* Value = Find(Name, FJsonValue::List);
		return Value && (Out = &Value->L, true);
	}
};

template <class T = TCHAR>
struct TJsonWriter
{
	FString* Out;
};

template <class T = TCHAR>
struct TJsonWriterFactory
{
	static TSharedRef<TJsonWriter<T>> Create(FString* Out) { return MakeShared<TJsonWriter<T>>(TJsonWriter<T>{Out}); }
};

template <class T = TCHAR>
struct TJsonReader
{
	FString Text;
};

template <class T = TCHAR>
struct TJsonReaderFactory
{
	static TSharedRef<TJsonReader<T>> Create(const FString& Text) { return MakeShared<TJsonReader<T>>(TJsonReader<T>{Text}); }
};

struct FJsonSerializer
{
	static void Write(std::string& Out, const FJsonValue& Value)
	{
		char Buffer[32];
		const char* Comma = "";
		switch (Value.Kind)
		{
		case FJsonValue::Null:
			Out += "null";
			break;
		case FJsonValue::Truth:
			Out += Value.bTruth ? "true" : "false";
			break;
		case FJsonValue::Number:
			std::snprintf(Buffer, sizeof Buffer, "%.17g", Value.N);
			Out += Buffer;
			break;
		case FJsonValue::Text:
			Out += '"' + Value.S.S + '"';
			break;
		case FJsonValue::List:
			Out += '[';
			for (const auto& One : Value.L)
			{
				Out += Comma;
				Write(Out, *One);
				Comma = ",";
			}
			Out += ']';
			break;
		case FJsonValue::Object:
			Out += '{';
			for (const auto& [Name, Field] : Value.O->Fields)
			{
				Out += Comma + ('"' + Name.S) + "\":";
				Write(Out, Field);
				Comma = ",";
			}
			Out += '}';
			break;
		}
	}
	static bool Serialize(const TSharedRef<FJsonObject>& Object, const TSharedRef<TJsonWriter<>>& Writer)
	{
		Write(Writer->Out->S, FJsonValueObject(Object));
		return true;
	}
	static void Skip(const char*& At)
	{
		while (*At == ' ' || *At == '\n' || *At == ',' || *At == ':')
		{
			At++;
		}
	}
	static TSharedPtr<FJsonValue> Read(const char*& At)
	{
		TSharedPtr<FJsonValue> Value = MakeShared<FJsonValue>();
		Skip(At);
		if (*At == '{' || *At == '[')
		{
			const bool bObject = *At == '{';
			Value->Kind = bObject ? FJsonValue::Object : FJsonValue::List;
			Value->O = MakeShared<FJsonObject>();
			for (At++, Skip(At); *At && *At != '}' && *At != ']'; Skip(At))
			{
				const TSharedPtr<FJsonValue> First = Read(At);
				if (bObject)
				{
					Value->O->Fields[First->S] = *Read(At);
				}
				else
				{
					Value->L.Add(First);
				}
			}
			At += *At ? 1 : 0;
		}
		else if (*At == '"')
		{
			Value->Kind = FJsonValue::Text;
			for (At++; *At && *At != '"'; At++)
			{
				At += *At == '\\' ? 1 : 0;
				Value->S.S += *At;
			}
			At += *At ? 1 : 0;
		}
		else if (*At == 't' || *At == 'f')
		{
			Value->Kind = FJsonValue::Truth;
			Value->bTruth = *At == 't';
			At += Value->bTruth ? 4 : 5;
		}
		else
		{
			char* End;
			Value->Kind = FJsonValue::Number;
			Value->N = std::strtod(At, &End);
			At = End == At ? At + std::string(At).size() : End;
		}
		return Value;
	}
	static bool Deserialize(const TSharedRef<TJsonReader<>>& Reader, TSharedPtr<FJsonObject>& Out)
	{
		const char* At = *Reader->Text;
		if (*At == '{')
		{
			Out = Read(At)->O;
		}
		return Out.IsValid();
	}
};

struct FBase64
{
	static bool Decode(const FString& Text, TArray<uint8>& Out)
	{
		static const std::string Alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
		unsigned Bits = 0, Count = 0;
		for (char Letter : Text.S)
		{
			const std::size_t Place = Alphabet.find(Letter);
			if (Place == std::string::npos)
			{
				break;
			}
			Bits = Bits << 6 | unsigned(Place);
			Count += 6;
			if (Count >= 8)
			{
				Count -= 8;
				Out.Add(uint8(Bits >> Count));
			}
		}
		return true;
	}
};

// HTTP.

class IHttpRequest;

class IHttpResponse
{
public:
	int32 Code = 0;
	FString Content;
	int32 GetResponseCode() const { return Code; }
	FString GetContentAsString() const { return Content; }
};

using FHttpRequestPtr = TSharedPtr<IHttpRequest>;
using FHttpResponsePtr = TSharedPtr<IHttpResponse>;

struct FHttpRequestCompleteDelegate
{
	std::function<void(FHttpRequestPtr, FHttpResponsePtr, bool)> Handler;
	template <class F>
	void BindWeakLambda(UObject*, F&& Function)
	{
		Handler = std::forward<F>(Function);
	}
};

struct Http
{
	/** Methods called, and calls to make. */
	static std::vector<std::string>& Sent()
	{
		static std::vector<std::string> All;
		return All;
	}
	static std::vector<std::function<void()>>& Waiting()
	{
		static std::vector<std::function<void()>> All;
		return All;
	}
	static void Deliver()
	{
		for (const auto& Call : std::exchange(Waiting(), {}))
		{
			Call();
		}
	}
};

class IHttpRequest
{
public:
	void SetURL(const FString& Value) { Url = Value.S; }
	void SetVerb(const FString& Value) { Head = Value.S; }
	void SetHeader(const FString& Name, const FString& Value) { Headers += Name.S + ": " + Value.S + "\r\n"; }
	void SetTimeout(float) {}
	void SetContentAsString(const FString& Value) { Body = Value.S; }
	FHttpRequestCompleteDelegate& OnProcessRequestComplete() { return Complete; }
	bool ProcessRequest()
	{
		Http::Sent().push_back(Url.substr(Url.rfind('/') + 1));
		Http::Waiting().push_back([Call = *this] { Call.Make(); });
		return true;
	}

private:
	void Make() const
	{
		const std::size_t Host = Url.find("//") + 2, Colon = Url.find(':', Host), Path = Url.find('/', Host);
		sockaddr_in To{};
		To.sin_family = AF_INET;
		To.sin_port = htons(uint16_t(std::stoi(Url.substr(Colon + 1))));
		inet_pton(AF_INET, Url.substr(Host, Colon - Host).c_str(), &To.sin_addr);
		const int Socket = socket(AF_INET, SOCK_STREAM, 0);
		std::string All;
		if (connect(Socket, reinterpret_cast<sockaddr*>(&To), sizeof To) == 0)
		{
			const std::string Whole = Head + " " + Url.substr(Path) + " HTTP/1.1\r\nHost: " + Url.substr(Host, Path - Host) + "\r\n" + Headers
				+ "Connection: close\r\nContent-Length: " + std::to_string(Body.size()) + "\r\n\r\n" + Body;
			std::size_t Done = 0;
			while (Done < Whole.size())
			{
				const ssize_t Count = write(Socket, Whole.data() + Done, Whole.size() - Done);
				if (Count <= 0)
				{
					break;
				}
				Done += std::size_t(Count);
			}
			char Buffer[65536];
			for (ssize_t Count; (Count = read(Socket, Buffer, sizeof Buffer)) > 0;)
			{
				All.append(Buffer, std::size_t(Count));
			}
		}
		close(Socket);
		const std::size_t Blank = All.find("\r\n\r\n");
		if (Blank == std::string::npos)
		{
			Complete.Handler(nullptr, nullptr, false);
			return;
		}
		TSharedPtr<IHttpResponse> Response = MakeShared<IHttpResponse>();
		Response->Code = std::stoi(All.substr(9, 3));
		Response->Content = FString(All.substr(Blank + 4));
		Complete.Handler(nullptr, Response, true);
	}

	std::string Url, Head, Headers, Body;
	FHttpRequestCompleteDelegate Complete;
};

struct FHttpModule
{
	static FHttpModule& Get()
	{
		static FHttpModule Module;
		return Module;
	}
	TSharedRef<IHttpRequest, ESPMode::ThreadSafe> CreateRequest() { return MakeShared<IHttpRequest>(); }
};
