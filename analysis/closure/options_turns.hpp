#pragma once

namespace ringlock::closure {

/// Numbers that decide what is named on a record of turns.
struct TurnOptions {};

}  // namespace ringlock::closure
