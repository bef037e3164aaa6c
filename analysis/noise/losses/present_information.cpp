#include "analysis/noise/losses/present_information.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <vector>

namespace ringlock::noise {
namespace {

/// Derivatives of the coefficients' variances by the parameters, constant over each bin.
class Derivatives {
   public:
    Derivatives(const Spectrum& spectrum, const Maximum& model) : of_(parameter_count) {
        const bool timed = model.theta[correlated] > 0.0;
        const CorrelatedShape shape(model.theta[log_time], spectrum.samples);
        for (const Bin& bin : spectrum.bins) {
            Parameters at{};
            for (std::size_t i = 0; i < bin.shape.size(); ++i) at[i] = bin.shape[i];
            if (timed) {
                const CorrelatedShape::Value there = shape(bin.sin2);
                at[correlated] = there.shape;
                at[log_time] = model.theta[correlated] * there.slope;
            }
            for (std::size_t i = 0; i < parameter_count; ++i) {
                of_[i].insert(of_[i].end(), static_cast<std::size_t>(bin.count), at[i]);
            }
        }
        count_ = timed ? parameter_count : static_cast<std::size_t>(correlated);
    }
    /// Parameters from the first on that the model has.
    std::size_t count() const { return count_; }
    Pair times(std::size_t parameter, const Pair& z, const CoefficientNoise& noise) const {
        Pair out(z.size());
        for (std::size_t j = 1; j < z.size(); ++j) out[j] = of_[parameter][j - 1] * z[j];
        if (parameter == quantisation) noise.add_ends(z, 1.0, out);
        return out;
    }

   private:
    std::vector<std::vector<double>> of_;
    std::size_t count_ = 0;
};

/// Of both series together.
double product(const Pair& a, const Pair& b) {
    double sum = 0.0;
    for (std::size_t j = 1; j < a.size(); ++j) sum += a[j].real() * b[j].real() + a[j].imag() * b[j].imag();
    return sum;
}

Pair weighed(const CoefficientNoise& noise, Pair z) {
    noise.weigh(z);
    return z;
}

/// Adds t_k^T C^-1 t_l/2 of a pair of draws.
void add_products(const std::vector<Pair>& t, const CoefficientNoise& noise, double share,
                  std::array<Parameters, parameter_count>& to) {
    for (std::size_t k = 0; k < t.size(); ++k) {
        const Pair w = weighed(noise, t[k]);
        for (std::size_t l = 0; l <= k; ++l) {
            const double value = 0.5 * share * product(t[l], w);
            to[k][l] += value;
            if (l != k) to[l][k] += value;
        }
    }
}

Pair drawn(const CoefficientNoise& noise, std::size_t pair) {
    random::NormalStream normal({noise.samples(), pair}, random::Purpose::lost_information);
    Pair z(noise.samples());
    for (std::size_t j = 1; j < z.size(); ++j) {
        const double real = normal();
        z[j] = {real, normal()};
    }
    noise.colour(z, normal);
    return z;
}

double ramp_inflation(const Spectrum& spectrum, const CoefficientNoise& noise, Conditional& conditional) {
    Pair ramp(spectrum.samples);
    for (std::size_t j = 1; j < spectrum.samples; ++j) ramp[j] = spectrum.ramp(j);
    const double complete = product(ramp, weighed(noise, ramp));
    conditional.complete(noise, ramp);
    const double present = product(ramp, weighed(noise, ramp));
    return present > 0.0 ? std::max(1.0, complete / present) : 1e3;
}

}  // namespace

LostInformation present_information(const Spectrum& spectrum, const Maximum& model, const CoefficientNoise& noise,
                                    std::span<const Gap> gaps, std::size_t pairs) {
    LostInformation out;
    const Derivatives derivatives(spectrum, model);
    const double share = 0.5 / static_cast<double>(pairs);
    for (std::size_t pair = 0; pair < pairs; ++pair) {
        Pair z = drawn(noise, pair);
        const Pair whole = weighed(noise, z);
        Conditional conditional(spectrum.samples, gaps);
        conditional.complete(noise, z);
        const Pair lossy = weighed(noise, z);
        std::vector<Pair> of_whole;
        std::vector<Pair> of_lossy(derivatives.count());
        for (std::size_t k = 0; k < derivatives.count(); ++k) of_whole.push_back(derivatives.times(k, whole, noise));
        oneapi::tbb::parallel_for(std::size_t{0}, derivatives.count(), [&](std::size_t k) {
            Conditional mine(spectrum.samples, gaps);
            of_lossy[k] = derivatives.times(k, lossy, noise);
            mine.complete(noise, of_lossy[k]);
        });
        add_products(of_whole, noise, share, out.complete);
        add_products(of_lossy, noise, share, out.present);
        if (pair == 0) out.ramp_inflation = ramp_inflation(spectrum, noise, conditional);
    }
    return out;
}

}  // namespace ringlock::noise
