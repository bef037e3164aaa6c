#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/noise/goodness.hpp"

namespace ringlock::noise {

/// A noise coefficient or what can be said where the record does not show it.
struct Coefficient {
    bool resolved = false;
    std::optional<double> value;  ///< where resolved; >= 0
    std::optional<double> lo;     ///< 68.27 % interval, where resolved
    std::optional<double>
        hi;  ///< its upper end; where not resolved a one-sided 95 % limit, or nothing if none can be given
};

/// An estimate with its 68.27 % interval.
struct Estimate {
    double value = 0.0;
    double lo = 0.0;
    double hi = 0.0;
};

/// Sinusoidal rate Omega_0 sin(2 pi f_0 t + phase): sigma^2(tau) = Omega_0^2 sin^4(pi f_0 tau)/(pi f_0 tau)^2.
struct Sinusoid {
    Estimate frequency_hz;          ///< f_0, as sampled: one above half the sampling rate appears folded below it
    Estimate rate_amplitude_deg_h;  ///< Omega_0 of the rate itself, before it was averaged over tau0
    double evidence = 0.0;          ///< fall of the deviance when it was found, all else free
};

/// Exponentially correlated rate: covariance rms^2 exp(-|t|/T_c), spectrum (q_c T_c)^2/(1 + (2 pi f T_c)^2).
struct Correlated {
    Estimate correlation_time_s;    ///< T_c
    Estimate amplitude_deg_h_rt_h;  ///< q_c, the intensity of the white noise that drives it
    Estimate rms_rate_deg_h;        ///< q_c (T_c/2)^(1/2)
    double evidence = 0.0;          ///< rise of the deviance without it, the five terms free
};

struct Options {
    double significance = 1e-3;           ///< of the likelihood-ratio test that a term must pass, with its search
    double nuisance_significance = 1e-2;  ///< of the same test: where correlated noise passes, the others are
                                          ///< estimated together with it, claimed or not
    double misfit_threshold = 2e-3;       ///< p below which each of the goodness-of-fit tests rejects
    std::size_t fewest_samples = 32;      ///< increments below which nothing is fitted
};

/// What is needed to decide over many records of like gyros together, where each by itself is too short to.
///
/// Evidence is the rise of the deviance when a term is left out: under the null 0 in half of the records, chi-squared
/// with one degree of freedom in the others. All 0 where nothing was fitted.
struct Pooling {
    double arw_evidence = 0.0;                     ///< for N, all other terms being free
    double angle_noise_evidence = 0.0;             ///< for Q in the model of Q and N
    double arw_alone_deg_rt_h = 0.0;               ///< N in the model of N alone
    double arw_beside_angle_noise_deg_rt_h = 0.0;  ///< N in the model of Q and N
    double arw_best_deg_rt_h = 0.0;                ///< N in the best subset that has it
    bool red = false;  ///< the best subset has flicker, rate random walk, correlated noise or a ramp
};

/// The coefficients of IEEE Std 952: sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2,
/// and what sinusoids and correlated noise there are.
struct NoiseFit {
    Coefficient quantization_arcsec;     ///< Q, rms of white angle noise
    Coefficient arw_deg_rt_h;            ///< N
    Coefficient bias_instability_deg_h;  ///< B; the flat floor itself is 0.664 B
    Coefficient rrw_deg_h_rt_h;          ///< K
    Coefficient rate_ramp_deg_h_h;       ///< |R|
    std::vector<Sinusoid> sinusoids;     ///< by frequency; at most three
    std::optional<Correlated> correlated;
    Pooling pooling;
    bool described = false;  ///< the model describes the record; false: do not print coefficients as truth
    std::string reason;      ///< where not: why (misfit, too short, no noise)
    Goodness goodness;
    std::size_t samples = 0;  ///< increments used
};

/// Noise coefficients from a record of angle by maximum likelihood on its cosine spectrum.
///
/// \param angle_arcsec  accumulated angle at uniform instants, length n + 1 for n increments, any offset and slope;
/// finite \param tau0_s        sampling interval [s], > 0 \return every coefficient with interval or limit; see
/// docs/dev/allan-coefficients.md for the method
///
/// A term is resolved if it belongs to the best subset of all (deviance plus the test's threshold for each term) and if
/// all the others together cannot take its place (likelihood ratio against the full model without it, half chi-squared
/// for a variance on its boundary). Sinusoids and correlated noise must also pass for the search over their frequency
/// and correlation time; they are in the full model only where they do. Bias instability moreover must dominate the
/// Allan variance somewhere between tau0 and a quarter of the record. A record without noise (all equal increments, a
/// pure ramp) resolves nothing. Thread-safe and deterministic; throws InputError where tau0 is not positive or a value
/// not finite.
NoiseFit fit_noise(std::span<const double> angle_arcsec, double tau0_s, const Options& options = {});

}  // namespace ringlock::noise
