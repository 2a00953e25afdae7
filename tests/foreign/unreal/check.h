// A test is a function; it fails by an exception.

#pragma once

#include "GraspMotion.h"

#include <cstdio>
#include <functional>
#include <stdexcept>
#include <string>

inline void Check(bool bCondition, const std::string& What)
{
	if (!bCondition)
	{
		throw std::runtime_error(What);
	}
}

inline void Near(grasp::Vector A, grasp::Vector B, double Most, const std::string& What)
{
	Check(grasp::Length(A - B) <= Most, What + ": " + std::to_string(grasp::Length(A - B)) + " apart");
}

inline void Near(grasp::Quaternion A, grasp::Quaternion B, double Most, const std::string& What)
{
	const double Sign = grasp::Dot(A, B) < 0 ? -1 : 1;
	for (double Off : {A.X - Sign * B.X, A.Y - Sign * B.Y, A.Z - Sign * B.Z, A.W - Sign * B.W})
	{
		Check(std::abs(Off) <= Most, What + ": turned by " + std::to_string(Off));
	}
}

inline void Near(const grasp::Pose& A, const grasp::Pose& B, double Distance, double Turn, const std::string& What)
{
	Near(A.Position, B.Position, Distance, What);
	Near(A.Orientation, B.Orientation, Turn, What);
}

/** Runs a test and prints its result; 1 if it failed. */
inline int Run(const char* Name, const std::function<void()>& Test)
{
	try
	{
		Test();
	}
	catch (const std::exception& Failure)
	{
		std::printf("FAILED %s: %s\n", Name, Failure.what());
		return 1;
	}
	std::printf("passed %s\n", Name);
	return 0;
}
