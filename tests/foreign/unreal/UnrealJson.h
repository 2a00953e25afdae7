// Unreal's JSON and Base64, as far as the plugin uses them.

#pragma once

#include "UnrealCore.h"

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
