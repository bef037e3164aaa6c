#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

/// Faults of a measured series that no noise model has: they are searched for before coefficients are estimated.
namespace ringlock::findings {

enum class Kind {
    outlier,   ///< one value far off its neighbours
    jump,      ///< the mean rate steps at one time
    variance,  ///< a stretch whose noise is larger or smaller than elsewhere
    wrap,      ///< a counter or an angle starts again from the other end of its range
    repeated,  ///< one value repeats for longer than chance allows
    clipped,   ///< values pile up at the end of their range
    gap,       ///< data are missing
};

/// "outlier", "jump", ...
const char* name_of(Kind kind);

struct Finding {
    Kind kind = Kind::outlier;
    std::size_t row = 0;     ///< first datum, counted from 0
    std::size_t length = 1;  ///< data from there on that are affected; of a jump, all that follow: 1 stands for it
    double size = 0.0;  ///< by which the datum is off, or the rate jumps [unit of the data]; ratio of the variances;
                        ///< modulus of a wrap; the value that repeats or is the limit; data missing in a gap
    double size_sigma = 0.0;  ///< of it over its standard error; of a variance, a normal deviate of the same chance
    bool of_angle = false;    ///< the angle jumps, and not the rate
};

/// Places of the findings in the order of a list that may be cut: gaps behind the others.
std::vector<std::size_t> listed(std::span<const Finding> found);

/// The kinds among these that coefficients are estimated without, as "outliers, jumps and repeated values"; empty
/// where none is: stretches of another variance and clipped data stay, gaps are no data.
std::string estimated_without(std::span<const Finding> found);

}  // namespace ringlock::findings
