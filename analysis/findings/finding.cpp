#include "analysis/findings/finding.hpp"

namespace ringlock::findings {

const char* name_of(Kind kind) {
    switch (kind) {
        case Kind::outlier:
            return "outlier";
        case Kind::jump:
            return "jump";
        case Kind::variance:
            return "variance";
        case Kind::wrap:
            return "wrap";
        case Kind::repeated:
            return "repeated";
        case Kind::clipped:
            break;
    }
    return "clipped";
}

}  // namespace ringlock::findings
