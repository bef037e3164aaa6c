#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <variant>
#include <vector>

/// Designs of computer experiments and sensitivity indices. The code here does not depend on the meaning of a factor or
/// on the evaluation of a point.
namespace ringlock::design {

/// Explicit values, in the order in which a grid or a list takes them; in a design of the unit cube all equally likely.
struct Values {
    std::vector<double> values;
};

enum class Scale { linear, log };

/// So many values from one end to the other, both ends among them, at equal distances or, on a logarithmic scale, at
/// equal ratios (both ends of one sign then). Two points or more; `to` may lie below `from`.
struct Range {
    double from = 0.0;
    double to = 1.0;
    std::uint64_t points = 2;
    Scale scale = Scale::linear;
};

struct Normal {
    double mean = 0.0;
    double sd = 1.0;  ///< standard deviation, above 0
};

struct Uniform {
    double from = 0.0;
    double to = 1.0;  ///< above from
};

/// The logarithm is normal with mean ln(median) and variance ln(1 + sd_relative^2) (Johnson, Kotz, Balakrishnan,
/// "Continuous univariate distributions" 1, 2nd ed. 1994, eq. 14.8).
struct Lognormal {
    double median = 1.0;       ///< above 0: the typical device, half the lot is below
    double sd_relative = 0.1;  ///< standard deviation of the value over its mean (coefficient of variation), above 0
};

struct Triangular {
    double from = 0.0;
    double mode = 0.5;  ///< from...to
    double to = 1.0;    ///< above from
};

/// One quantity that an experiment varies, identified by its key. Units are those of the key.
struct Factor {
    std::string key;
    std::variant<Values, Range, Normal, Uniform, Lognormal, Triangular> takes;
    /// Values that the key allows, both ends included. Values and ranges must lie within; a distribution is cut off
    /// there.
    double lower = -std::numeric_limits<double>::infinity();
    double upper = std::numeric_limits<double>::infinity();
};

/// A distribution of which less than this lies within its factor's bounds is taken for a mistake.
inline constexpr double least_share_within_bounds = 0.01;

/// Whether the factor has a distribution; otherwise it has levels.
bool has_distribution(const Factor& factor);

/// Number of the factor's levels; 0 where it has a distribution.
std::uint64_t level_count(const Factor& factor);

/// \param index  below level_count()
double level(const Factor& factor, std::uint64_t index);

/// Throws InputError, with the key, where a factor cannot be: no key, no value, numbers that are not finite, a
/// deviation that is not above 0, values outside the bounds, bounds that are not in order, or a distribution of which
/// less than least_share_within_bounds lies within them.
void check(const Factor& factor);

/// The same for all factors of a design; also throws without factors and where two have the same key.
void check(std::span<const Factor> factors);

/// A probability and its complement, each exact where it is small.
struct Probability {
    double below = 0.0;
    double above = 1.0;
    static Probability of(double u) { return {u, 1.0 - u}; }
};

/// From the unit interval to values of one factor.
///
/// A distribution F is truncated at its bounds a and b. Its quantile function is x(u) = F^-1(F(a) + u (F(b) - F(a))),
/// so that mean and standard deviation are those of the truncated distribution. Boost's quantiles are computed from the
/// smaller of the two tails, so that no digits are lost in either. x(u) never decreases (but for the last digit of
/// Boost's quantiles, where two u are neighbours) and never leaves the bounds. Levels are equally likely: u in [i/n, (i
/// + 1)/n) is level i of n.
class Marginal {
   public:
    /// Throws the exceptions of check().
    explicit Marginal(const Factor& factor);

    /// \param u  above 0 and below 1; InputError otherwise
    double operator()(double u) const;

    /// The same by both tails: probabilities beyond 1 - 1e-16 keep their digits, too.
    ///
    /// \param u  either tail above 0 and below or at 1; InputError otherwise
    double operator()(Probability u) const;

    /// How much of the distribution lies within the bounds, 0.01...1; 1 for levels.
    double share_within_bounds() const { return within_; }

   private:
    Factor factor_;
    std::uint64_t levels_ = 0;
    double below_ = 0.0;   ///< probability below the lower bound
    double above_ = 0.0;   ///< and above the upper one
    double within_ = 1.0;  ///< and between
};

}  // namespace ringlock::design
