// The part of Unreal that the plugin uses.

#pragma once

#include "UnrealComponents.h"
#include "UnrealHttp.h"
#include "UnrealJson.h"
