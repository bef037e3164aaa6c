#include "analysis/closure/closure.hpp"

namespace ringlock::closure {

std::string_view name_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::nothing_missing:
            return "nothing_missing";
        case Verdict::closed:
            return "closed";
        case Verdict::unexplained:
            break;
    }
    return "unexplained";
}

Closure close_loop(const record::Record& record) { return record.turns ? close_turns(record) : close_samples(record); }

}  // namespace ringlock::closure
