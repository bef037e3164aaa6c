#pragma once

/// Allan family of frequency-stability estimators.
namespace ringlock::allan {}
