#include "analysis/closure/sample_unrounding.hpp"

#include <algorithm>
#include <boost/math/special_functions/erf.hpp>
#include <boost/random/mersenne_twister.hpp>
#include <boost/random/normal_distribution.hpp>
#include <boost/random/uniform_01.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

double upper_tail(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

/// A normal number between two bounds: its probability, and a draw.
class Between {
   public:
    Between(double low, double high) : turned_(low + high < 0.0) {
        // The side on which both are small numbers
        near_ = turned_ ? -high : low;
        of_near_ = upper_tail(near_);
        of_far_ = upper_tail(turned_ ? -low : high);
    }
    double probability() const { return of_near_ - of_far_; }
    double draw(double uniform) const {
        constexpr double least = 1e-300;
        const double tail = of_far_ + uniform * (of_near_ - of_far_);
        const double z = tail > least ? std::numbers::sqrt2 * boost::math::erfc_inv(2.0 * tail) : near_;
        return turned_ ? -z : z;
    }
    /// Minus the logarithm of the density at the bound that is nearest.
    double distance() const { return near_ > 0.0 ? 0.5 * near_ * near_ : 0.0; }

   private:
    bool turned_;
    double near_, of_near_, of_far_;
};

}  // namespace

bool rounding_shows(double step_arcsec, double sd_arcsec) {
    constexpr double shows = 0.01;
    const double turns = sd_arcsec / step_arcsec;
    return std::exp(-2.0 * units::pi * units::pi * turns * turns) > shows;
}

namespace {

class Mixture {
   public:
    enum class Paths { kept, forgotten };
    Mixture(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec, std::uint64_t seed,
            Paths paths);
    /// Goes on to the next increment, and draws its reading.
    void go_on();
    /// The increment that comes next.
    void foretell(Foretold& foretold) const;
    std::vector<double> path();
    double log_probability() const { return log_probability_; }

   private:
    /// Of the filters' readings of that row; the same for all where paths are not kept.
    std::size_t at_row(std::size_t row) const { return drawn_.size() > count_ ? row * count_ : 0; }
    double uniform() { return boost::random::uniform_01<double>()(generator_); }
    void advance();
    void draw_anew(std::uint8_t* parent);

    const SampleFilter& filter_;
    const std::vector<double>& rounded_;
    const double step_;
    const std::size_t count_;
    boost::random::mt19937_64 generator_;
    boost::random::normal_distribution<double> normal_;
    std::vector<double> no_noise_;
    std::size_t row_ = 0;
    double total_ = 0.0;       ///< of the rounded increments
    double determined_ = 0.0;  ///< of what is no noise
    double log_probability_ = 0.0;
    std::vector<SampleFilter::State> state_;
    std::vector<double> weight_;
    std::vector<double> foretold_;      ///< next reading
    std::vector<float> drawn_;          ///< all readings, within their steps
    std::vector<std::uint8_t> parent_;  ///< whom each continued
};

/// The rarer an angle crosses a step beside its noise, the more must be kept to hit it.
std::size_t filters_for(double step_over_sd) {
    std::size_t count = 64;
    while (count < 256 && static_cast<double>(count) < 16.0 * step_over_sd) count *= 2;
    return count;
}

Mixture::Mixture(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec, std::uint64_t seed,
                 Paths paths)
    : filter_(fit.filter()),
      rounded_(rounded),
      step_(step_arcsec),
      count_(filters_for(step_arcsec / fit.sd(rounded.size() / 2))),
      generator_(seed),
      no_noise_(fit.determined()),
      state_(count_),
      weight_(count_, 1.0 / static_cast<double>(count_)),
      foretold_(count_),
      drawn_(count_ * (paths == Paths::kept ? rounded.size() + 1 : 1)),
      parent_(drawn_.size()) {
    for (std::size_t p = 0; p < count_; ++p) {
        const double first = (static_cast<double>(p) + uniform()) / static_cast<double>(count_) - 0.5;
        drawn_[p] = static_cast<float>(first);
        filter_.begin(first * step_, state_[p]);
    }
    advance();
}

void Mixture::advance() {
    if (row_ == rounded_.size()) return;
    determined_ += no_noise_[row_];
    draw_anew(parent_.data() + at_row(row_ + 1));
    for (std::size_t p = 0; p < count_; ++p) foretold_[p] = determined_ + filter_.foretell(state_[p]);
}

/// Where few of them have most of the weight: evenly along its sum (Kitagawa, J. Comput. Graph. Stat. 5, 1, 1996).
void Mixture::draw_anew(std::uint8_t* parent) {
    for (std::size_t p = 0; p < count_; ++p) parent[p] = static_cast<std::uint8_t>(p);
    const double squares = std::inner_product(weight_.begin(), weight_.end(), weight_.begin(), 0.0);
    if (squares * static_cast<double>(count_) < 2.0) return;
    const auto before = state_;
    double sum = weight_[0];
    std::size_t from = 0;
    const double start = uniform();
    for (std::size_t p = 0; p < count_; ++p) {
        const double at = (static_cast<double>(p) + start) / static_cast<double>(count_);
        while (sum < at && from + 1 < count_) sum += weight_[++from];
        state_[p] = before[from];
        parent[p] = static_cast<std::uint8_t>(from);
    }
    std::fill(weight_.begin(), weight_.end(), 1.0 / static_cast<double>(count_));
}

void Mixture::go_on() {
    constexpr double impossible = 1e-250;
    constexpr double far = 6.0;  // beyond that are 2e-9
    const double sd = filter_.sd(row_);
    total_ += rounded_[row_];
    double sum = 0.0;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < count_; ++p) {
        const double low = (total_ - 0.5 * step_ - foretold_[p]) / sd;
        const double high = low + step_ / sd;
        double z = 0.0;
        if (low < -far && high > far) {
            nearest = 0.0;
            z = std::clamp(normal_(generator_), low, high);
        } else {
            const Between between(low, high);
            nearest = std::min(nearest, between.distance());
            z = std::clamp(between.draw(uniform()), low, high);
            weight_[p] *= between.probability();
        }
        filter_.take(row_, z * sd, state_[p]);
        drawn_[at_row(row_ + 1) + p] = static_cast<float>((foretold_[p] + z * sd - total_) / step_);
        sum += weight_[p];
    }
    log_probability_ = sum > impossible ? std::log(sum) : -nearest;
    for (double& w : weight_) w = sum > impossible ? w / sum : 1.0 / static_cast<double>(count_);
    ++row_;
    advance();
}

void Mixture::foretell(Foretold& foretold) const {
    constexpr double reach = 4.5;
    constexpr double most_steps = 60.0;
    const double sd = filter_.sd(row_);
    const auto [lowest, highest] = std::minmax_element(foretold_.begin(), foretold_.end());
    const double first = std::floor((*lowest - reach * sd - total_) / step_ + 0.5);
    const double last = std::min(std::floor((*highest + reach * sd - total_) / step_ + 0.5), first + most_steps);
    std::vector<double> above(count_);
    const auto tail = [&](std::size_t p, double m) {
        return upper_tail((total_ + (m - 0.5) * step_ - foretold_[p]) / sd);
    };
    for (std::size_t p = 0; p < count_; ++p) above[p] = tail(p, first);
    std::vector<double> probabilities;
    double mean = 0.0;
    for (double m = first; m <= last; m += 1.0) {
        double probability = 0.0;
        for (std::size_t p = 0; p < count_; ++p) {
            const double next = tail(p, m + 1.0);
            probability += weight_[p] * (above[p] - next);
            above[p] = next;
        }
        mean += probability * m * step_;
        probabilities.push_back(probability);
    }
    double variance = 0.0;
    double fourth = 0.0;
    for (std::size_t k = 0; k < probabilities.size(); ++k) {
        const double square = std::pow((first + static_cast<double>(k)) * step_ - mean, 2);
        variance += probabilities[k] * square;
        fourth += probabilities[k] * square * square;
    }
    foretold.mean.push_back(mean);
    foretold.variance.push_back(variance);
    foretold.fourth_moment.push_back(fourth);
}

std::vector<double> Mixture::path() {
    double place = uniform();
    std::size_t p = 0;
    while (p + 1 < count_ && place > weight_[p]) place -= weight_[p++];
    std::vector<double> increments(rounded_.size());
    for (std::size_t k = rounded_.size(); k-- > 0;) {
        const auto later = static_cast<double>(drawn_[(k + 1) * count_ + p]);
        p = parent_[(k + 1) * count_ + p];
        increments[k] = rounded_[k] + (later - static_cast<double>(drawn_[k * count_ + p])) * step_;
    }
    return increments;
}

}  // namespace

std::vector<double> unround(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                            std::uint64_t seed) {
    check_interrupt();
    Mixture mixture(fit, rounded, step_arcsec, seed, Mixture::Paths::kept);
    for (std::size_t k = 0; k < rounded.size(); ++k) mixture.go_on();
    return mixture.path();
}

Foretold foretell_rounded(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec) {
    check_interrupt();
    Mixture mixture(fit, rounded, step_arcsec, 0, Mixture::Paths::forgotten);
    Foretold foretold;
    for (std::size_t k = 0; k < rounded.size(); ++k) {
        mixture.foretell(foretold);
        mixture.go_on();
        foretold.log_probability.push_back(mixture.log_probability());
    }
    return foretold;
}

double log_likelihood_of_rounded(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                                 std::size_t until) {
    check_interrupt();
    Mixture mixture(fit, rounded, step_arcsec, 0, Mixture::Paths::forgotten);
    double sum = 0.0;
    for (std::size_t k = 0; k < std::min(until, rounded.size()); ++k) {
        mixture.go_on();
        if (fit.rows()[k]) sum += mixture.log_probability();
    }
    return sum;
}

}  // namespace ringlock::closure
