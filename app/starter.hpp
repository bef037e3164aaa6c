#pragma once
#include <string>

#include "engine/scenario/devices.hpp"

namespace ringlock::app {

/// A scenario to begin with, as commented TOML: the keys that most studies choose at their defaults, all others as
/// comments, each with unit, bounds and meaning. Without its comments it is the empty scenario of the device; lines
/// that begin with '#' and no blank after it are keys and sections, which can be uncommented one by one.
///
/// \param device  whose constants are the defaults; null for those of Gao and Deng (2007)
std::string starter_text(const scenario::NamedDevice* device);

}  // namespace ringlock::app
