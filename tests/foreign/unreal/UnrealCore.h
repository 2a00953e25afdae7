// Unreal's strings, containers, pointers and transforms, as far as the plugin uses them.

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
