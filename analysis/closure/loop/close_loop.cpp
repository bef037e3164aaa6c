#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/turns/loop/loop.hpp"

namespace ringlock::closure {

Closure close_loop(const record::Record& record, const Monitor& monitor) {
    return record.turns ? close_turns(record, monitor) : close_samples(record, monitor);
}

}  // namespace ringlock::closure
