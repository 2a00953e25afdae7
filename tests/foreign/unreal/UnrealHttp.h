// Unreal's HTTP requests, as far as the plugin uses them. Answers come by Http::Deliver.

#pragma once

#include "UnrealCore.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

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
