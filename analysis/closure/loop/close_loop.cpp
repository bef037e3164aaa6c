#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/turns/loop/loop.hpp"

namespace ringlock::closure {

Closure close_loop(const record::Record& record) { return record.turns ? close_turns(record) : close_samples(record); }

}  // namespace ringlock::closure
