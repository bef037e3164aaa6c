#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/lot/confidence.hpp"

namespace ringlock::lot {

/// Gyros at the first look, and the fewest values that a random walk's precision is judged by.
constexpr std::int64_t first_look = 16;

/// The next number of gyros at which a rule may look: 16, 32, 64, ... below `most`, then `most` itself. Fixed numbers,
/// each twice the one before, leave a rule few chances to stop on a lucky lot.
///
/// \param n     gyros that are there, 0 or more; need not be a look
/// \param most  gyros of the largest lot, at least 1
/// \return absent where n is `most` or more
/// Throws InputError where n or most is outside.
std::optional<std::int64_t> next_look(std::int64_t n, std::int64_t most);

/// Half widths of intervals at which a lot is large enough; an absent one is no condition.
struct Precision {
    /// Of the geometric mean of each arm's random walk: upper end over mean less 1. Positive.
    std::optional<double> arw_relative;
    /// For each yield, half the width of its exact interval, a share. In (0, 0.5).
    std::optional<double> yield_absolute;
};

/// The random walks of one arm at a look.
struct ArwColumn {
    std::string name;
    std::span<const double> values;  ///< one a gyro, in any unit; NaN: this gyro has none
};

/// One yield at a look: of all gyros, k are within the limit.
struct YieldCount {
    std::string name;
    std::int64_t k = 0;
};

/// One requested precision.
struct Reached {
    std::string name;               ///< of the column or the yield
    double wanted = 0.0;            ///< requested half width
    std::optional<double> reached;  ///< half width; absent where there is no interval
    bool met = false;
};

/// Decision of a rule at a look.
struct Decision {
    bool stop = false;
    bool precise = false;              ///< every requested precision is reached; false without a request
    std::optional<std::int64_t> next;  ///< gyros of the next look; absent where the lot stops
    std::vector<Reached> figures;      ///< random walks, then yields, in the order given
    std::string why;                   ///< a sentence for a reader
};

/// Runs a lot until it is precise enough. A study calls next(0), runs that many gyros, calls decide(), and goes on to
/// its `next` unless that stops. It reports all figures of the lot with confidence(), the last look's included.
class StoppingRule {
   public:
    /// \param precision   half widths to reach
    /// \param most_gyros  the lot stops there in any case, at least 1
    /// \param level       of every interval, in (0, 1)
    /// Throws InputError where one is outside.
    StoppingRule(const Precision& precision, std::int64_t most_gyros, double level = 0.95);

    /// Intervals of a lot that this rule stopped: until_precise if any precision is requested.
    Confidence confidence() const;

    /// next_look(), but most_gyros alone where no precision is requested.
    std::optional<std::int64_t> next(std::int64_t gyros) const;

    /// Decides whether to stop or to go on.
    ///
    /// \param gyros   of the lot so far: must be a look of next()
    /// \param arws    the arms whose random walk is to be known; at least one if arw_relative is set
    /// \param yields  the yields to be known; at least one if yield_absolute is set
    /// Throws InputError where gyros is no look, a column has another length, k exceeds the lot, or the data for a
    /// requested precision are missing.
    Decision decide(std::int64_t gyros, std::span<const ArwColumn> arws, std::span<const YieldCount> yields) const;

   private:
    Precision precision_;
    std::int64_t most_gyros_;
    double level_;
};

}  // namespace ringlock::lot
