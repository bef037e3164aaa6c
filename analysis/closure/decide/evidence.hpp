#pragma once
#include <initializer_list>
#include <optional>
#include <vector>

#include "analysis/closure/types.hpp"
#include "engine/effects/effect.hpp"

/// How much evidence an effect of the library needs: its free parameters and the choice among all effects, by the roles
/// that an effect gives its parameters.
namespace ringlock::closure {

/// Number of parameters of the effect with one of these roles.
int count_of(const effects::Effect& effect, std::initializer_list<effects::Role> roles);

/// Whether the effect is a random rate: such a process can follow, more or less, anything that the library lacks.
bool is_random_rate(const effects::Effect& effect);

/// Cost of choosing one more effect among all of the library [nats].
double cost_of_choice();

/// Significance level of each single effect when all of the library is tried.
double level_of_one_effect();

/// Whether so small a p-value is rare enough for one of all effects of the library.
bool passes(double p_value);

/// Probability of so large a gain of the log-likelihood by chance, with all free parameters of the effect.
double p_of_gain(double gain, const effects::Effect& effect);

/// Evidence that an effect does what it has in addition to a smaller one that it contains: the logarithm of the Bayes
/// factor [nats], each additional size normal about zero with its typical proportion to the sizes in common as its
/// standard deviation. Near zero where the record could not show sizes in that proportion, so that the two are tied;
/// negative where it could and does not show them. Correlations between the sizes are neglected. None where a size has
/// no typical proportion.
/// \param fitted  estimates of the larger effect's parameters, with standard errors
/// \param log_likelihood_ratio  of the two best fits [nats]: an upper bound of the logarithm of the Bayes factor, which
///        holds where the likelihood is far from normal, as it is where neither effect made the record
std::optional<double> evidence_for_addition(const effects::Effect& larger, const effects::Effect& smaller,
                                            const std::vector<Estimate>& fitted, double log_likelihood_ratio);

}  // namespace ringlock::closure
