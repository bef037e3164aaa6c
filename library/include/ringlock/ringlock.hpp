#pragma once
// All of the library. docs/library.md is its guide.
#include <ringlock/allan.hpp>
#include <ringlock/closure.hpp>
#include <ringlock/device.hpp>
#include <ringlock/error.hpp>
#include <ringlock/settings.hpp>
#include <ringlock/study.hpp>
#include <ringlock/version.hpp>
