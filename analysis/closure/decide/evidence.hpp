#pragma once
#include <initializer_list>
#include <optional>
#include <vector>

#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

/// The evidence that an effect of the library needs: its free parameters and the choice among all effects, by the
/// roles that an effect gives its parameters.
namespace ringlock::closure {

/// Number of parameters of the effect with one of these roles.
int count_of(const effects::Effect& effect, std::initializer_list<effects::Role> roles);

/// Whether the effect is a random rate. Such a process can follow nearly any cause that the library lacks.
bool is_random_rate(const effects::Effect& effect);

/// Cost of the choice of one more effect from the whole library [nats].
double cost_of_choice();

/// Significance level of each single effect when the whole library is tried.
double level_of_one_effect();

/// Whether the p-value passes the level of one effect of the library.
bool passes(double p_value);

/// Probability by chance of a gain of the log-likelihood as large as this, with all free parameters of the effect.
double p_of_gain(double gain, const effects::Effect& effect);

/// Evidence for the sizes that an effect has in addition to a smaller effect that it contains: the logarithm of the
/// Bayes factor [nats]. The prior of each additional size is normal about zero; its standard deviation is the typical
/// proportion of that size to the common sizes. The evidence is near zero where the record could not show sizes in that
/// proportion, so that the two effects are tied, and negative where it could and does not show them. Correlations
/// between the sizes are neglected. None where a size has no typical proportion.
/// \param fitted  estimates of the larger effect's parameters, with standard errors
/// \param log_likelihood_ratio  of the two best fits [nats]: an upper bound of the logarithm of the Bayes factor, which
/// also holds where the likelihood is far from normal, as it is where neither effect is the cause
std::optional<double> evidence_for_addition(const effects::Effect& larger, const effects::Effect& smaller,
                                            const std::vector<Estimate>& fitted, double log_likelihood_ratio);

}  // namespace ringlock::closure
