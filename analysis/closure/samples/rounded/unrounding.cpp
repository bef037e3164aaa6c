#include "analysis/closure/samples/rounded/unrounding.hpp"

#include <hwy/contrib/sort/vqsort.h>

#include <algorithm>
#include <boost/random/mersenne_twister.hpp>
#include <boost/random/uniform_01.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/normals_between.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

double upper_tail(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

}  // namespace

std::size_t filters_for(double step_arcsec, double sd_arcsec) {
    const SampleRoundedOptions& by = options.samples.rounded;
    const double wanted = by.filters_per_step * step_arcsec / sd_arcsec;
    std::size_t count = by.fewest_filters;
    while (count < by.most_filters && static_cast<double>(count) < wanted) count *= 2;
    return count;
}

bool rounding_shows(double step_arcsec, double sd_arcsec) {
    const double turns = sd_arcsec / step_arcsec;
    return std::exp(-2.0 * units::pi * units::pi * turns * turns) > options.samples.rounded.rounding_shows;
}

namespace {

class Mixture {
   public:
    enum class Paths { kept, forgotten };
    Mixture(const SampleFit& fit, const RoundedIncrements& rounded, std::uint64_t seed, Paths paths);
    /// Processes the next increment and draws its reading.
    void go_on();
    /// Distribution of the next increment.
    void predict(Prediction& predicted) const;
    std::vector<double> path();
    double log_probability() const { return log_probability_; }

   private:
    /// Start of the filters' readings at that row; the same for all rows where paths are not kept.
    std::size_t at_row(std::size_t row) const { return drawn_.size() > count_ ? row * count_ : 0; }
    double uniform() { return boost::random::uniform_01<double>()(generator_); }
    void advance();
    void draw_anew();
    double distance(double width) const;

    const SampleFilter& filter_;
    const std::span<const double> rounded_;
    const double step_;
    const std::size_t count_;
    boost::random::mt19937_64 generator_;
    std::vector<double> no_noise_;
    std::size_t row_ = 0;
    double total_ = 0.0;       ///< of the rounded increments
    double determined_ = 0.0;  ///< of the deterministic part
    double log_probability_ = 0.0;
    std::vector<float> drawn_;          ///< all readings, within their steps
    std::vector<std::uint8_t> parent_;  ///< index of the filter that each continued
    SampleFilter::Many filters_;
    std::vector<double> weight_;
    std::vector<double> predicted_;   ///< next reading
    std::vector<double> innovation_;  ///< of the last reading
    std::vector<double> low_, share_, probability_;
    std::vector<std::uint64_t> key_;  ///< rank of a filter by its prediction, with its index in the last byte
    hwy::Sorter sorter_;
    std::vector<std::uint8_t> from_;
};

std::vector<double> within(std::size_t count, double step_arcsec) {
    std::vector<double> readings(count);
    for (std::size_t p = 0; p < count; ++p) {
        readings[p] = ((static_cast<double>(p) + 0.5) / static_cast<double>(count) - 0.5) * step_arcsec;
    }
    return readings;
}

Mixture::Mixture(const SampleFit& fit, const RoundedIncrements& rounded, std::uint64_t seed, Paths paths)
    : filter_(fit.filter()),
      rounded_(rounded.arcsec),
      step_(rounded.step_arcsec),
      count_(rounded.filters),
      generator_(seed),
      no_noise_(fit.determined()),
      drawn_(count_ * (paths == Paths::kept ? rounded_.size() + 1 : 1)),
      parent_(drawn_.size()),
      filters_(filter_, within(count_, step_)),
      weight_(count_, 1.0 / static_cast<double>(count_)),
      predicted_(count_),
      innovation_(count_),
      low_(count_),
      share_(count_),
      probability_(count_),
      key_(count_),
      from_(count_) {
    for (std::size_t p = 0; p < count_; ++p) {
        drawn_[p] = static_cast<float>((static_cast<double>(p) + 0.5) / static_cast<double>(count_) - 0.5);
    }
    advance();
}

void Mixture::advance() {
    if (row_ == rounded_.size()) return;
    determined_ += no_noise_[row_];
    filters_.predict(predicted_);
    for (double& reading : predicted_) reading += determined_;
    draw_anew();
}

/// Resamples the filters, evenly along the sum of the weights (Kitagawa, J. Comput. Graph. Stat. 5, 1, 1996), in the
/// order of their predictions and with the same random numbers for every model: the likelihood is then a nearly smooth
/// function of the model (Malik and Pitt, J. Econom. 165, 190, 2011).
void Mixture::draw_anew() {
    constexpr double same = 1e-9;
    constexpr double steps = 0x1p54;
    const double start = uniform();
    std::uint8_t* parent = parent_.data() + at_row(row_ + 1);
    std::iota(parent, parent + count_, std::uint8_t{0});
    const auto [least, most] = std::minmax_element(weight_.begin(), weight_.end());
    if (*most - *least < same * *most) return;
    const auto [lowest, highest] = std::minmax_element(predicted_.begin(), predicted_.end());
    const double scale = steps / std::max(*highest - *lowest, 1e-300);
    for (std::size_t p = 0; p < count_; ++p) {
        key_[p] = static_cast<std::uint64_t>((predicted_[p] - *lowest) * scale) << 8U | p;
    }
    sorter_(key_.data(), count_, hwy::SortAscending());
    const auto at_place = [&](std::size_t k) { return static_cast<std::uint8_t>(key_[k] & 0xFFU); };
    double sum = weight_[at_place(0)];
    std::size_t from = 0;
    for (std::size_t p = 0; p < count_; ++p) {
        const double at = (static_cast<double>(p) + start) / static_cast<double>(count_);
        while (sum < at && from + 1 < count_) sum += weight_[at_place(++from)];
        parent[p] = at_place(from);
    }
    std::copy(parent, parent + count_, from_.begin());
    filters_.continue_from(from_);
    for (std::size_t p = 0; p < count_; ++p) innovation_[p] = predicted_[from_[p]];
    predicted_.swap(innovation_);
    std::fill(weight_.begin(), weight_.end(), 1.0 / static_cast<double>(count_));
}

void Mixture::go_on() {
    constexpr double impossible = 1e-250;
    const double sd = filter_.sd(row_);
    const double width = step_ / sd;
    total_ += rounded_[row_];
    for (std::size_t p = 0; p < count_; ++p) low_[p] = (total_ - 0.5 * step_ - predicted_[p]) / sd;
    for (double& share : share_) share = uniform();
    normals_between(low_, width, share_, probability_, innovation_);
    double sum = 0.0;
    float* drawn = drawn_.data() + at_row(row_ + 1);
    for (std::size_t p = 0; p < count_; ++p) {
        drawn[p] = static_cast<float>((innovation_[p] - low_[p]) / width - 0.5);
        weight_[p] *= probability_[p];
        innovation_[p] *= sd;
        sum += weight_[p];
    }
    filters_.take(row_, innovation_);
    log_probability_ = sum > impossible ? std::log(sum) : -distance(width);
    for (double& w : weight_) w = sum > impossible ? w / sum : 1.0 / static_cast<double>(count_);
    ++row_;
    advance();
}

/// Minus the logarithm of the density at the nearest bound.
double Mixture::distance(double width) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const double low : low_) nearest = std::min(nearest, std::max({low, -low - width, 0.0}));
    return 0.5 * nearest * nearest;
}

void Mixture::predict(Prediction& predicted) const {
    constexpr double reach = 4.5;
    constexpr double most_steps = 60.0;
    const double sd = filter_.sd(row_);
    const auto [lowest, highest] = std::minmax_element(predicted_.begin(), predicted_.end());
    const double first = std::floor((*lowest - reach * sd - total_) / step_ + 0.5);
    const double last = std::min(std::floor((*highest + reach * sd - total_) / step_ + 0.5), first + most_steps);
    std::vector<double> above(count_);
    const auto tail = [&](std::size_t p, double m) {
        return upper_tail((total_ + (m - 0.5) * step_ - predicted_[p]) / sd);
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
    predicted.mean.push_back(mean);
    predicted.variance.push_back(variance);
    predicted.fourth_moment.push_back(fourth);
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

std::vector<double> impute(const SampleFit& fit, const RoundedIncrements& rounded, std::uint64_t seed) {
    check_interrupt();
    Mixture mixture(fit, rounded, seed, Mixture::Paths::kept);
    for (std::size_t k = 0; k < rounded.arcsec.size(); ++k) mixture.go_on();
    return mixture.path();
}

Prediction predict_rounded(const SampleFit& fit, const RoundedIncrements& rounded) {
    check_interrupt();
    Mixture mixture(fit, rounded, 0, Mixture::Paths::forgotten);
    Prediction predicted;
    for (std::size_t k = 0; k < rounded.arcsec.size(); ++k) {
        mixture.predict(predicted);
        mixture.go_on();
        predicted.log_probability.push_back(mixture.log_probability());
    }
    return predicted;
}

double log_likelihood_of_rounded(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until) {
    check_interrupt();
    Mixture mixture(fit, rounded, 0, Mixture::Paths::forgotten);
    double sum = 0.0;
    for (std::size_t k = 0; k < std::min(until, rounded.arcsec.size()); ++k) {
        mixture.go_on();
        if (fit.rows()[k]) sum += mixture.log_probability();
    }
    return sum;
}

}  // namespace ringlock::closure
