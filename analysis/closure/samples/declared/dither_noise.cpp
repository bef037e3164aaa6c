#include "analysis/closure/samples/declared/dither_noise.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/declared/turn_pattern.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Path of the dither from the amplitude at one turn to that at the next.
enum class Path {
    cosine,    ///< amplitudes are drawn turn by turn: along a cosine from one turn's angle to the next
    resonator  ///< a noisy drive has the amplitude of a resonator grow evenly (engine/gyro/half_cycle.hpp)
};

/// Amplitudes of a resonator are correlated; amplitudes that are drawn turn by turn are not.
Path path_with(double memory) { return memory > 0.0 ? Path::resonator : Path::cosine; }

/// 1/(2 Q) of a resonator with the correlation exp(-pi/(2 Q)) from turn to turn.
double damping_with(double memory) { return -std::log(memory) / units::pi; }

/// Weights of a reading between two turns.
DitherRows rows_of(const SampleSeries& series, const DitherNoise& noise, bool notched) {
    DitherRows rows;
    const Path path = path_with(noise.memory);
    const double damping = path == Path::resonator ? damping_with(noise.memory) : 0.0;
    double before = 0.0;
    for (std::size_t i = 0; i < series.size(); ++i) {
        const double turns = noise.turn_hz * series.interval_s * static_cast<double>(i + 1) + noise.place;
        const double cycle = 2.0 * std::floor(0.5 * turns);
        const double middle = 1.0 + noise.asymmetry;
        const bool first = turns - cycle < middle;
        const double last = first ? cycle : cycle + 1.0;
        const double gone = first ? (turns - cycle) / middle : (turns - cycle - middle) / (2.0 - middle);
        const double cosine = std::cos(units::pi * gone);
        const double sign = first ? 1.0 : -1.0;
        rows.passed.push_back(static_cast<std::uint16_t>(last - before));
        before = last;
        if (path == Path::cosine) {
            rows.last.push_back(0.5 * sign * (1.0 + cosine));
            rows.next.push_back(-0.5 * sign * (1.0 - cosine));
            rows.follower.push_back(notched ? -sign * cosine : 0.0);
            continue;
        }
        const double sine = std::sin(units::pi * gone);
        rows.last.push_back(sign * ((1.0 - gone) * cosine + sine / units::pi));
        rows.next.push_back(sign * (gone * cosine - sine / units::pi));
        if (notched) {
            rows.follower.push_back(-sign * cosine);
            continue;
        }
        // The quadrature at the next turn follows from that at the last turn and from both amplitudes.
        const double of_next = -0.5 * damping * sign * sine * gone * noise.memory;
        rows.last.back() -= of_next;
        rows.next.back() += of_next;
        rows.follower.push_back(-0.5 * damping * sign * sine * (1.0 - gone) + of_next);
    }
    return rows;
}

class Search {
   public:
    Search(const SampleFit& base, double notch_hz) : base_(base), notch_hz_(notch_hz) {}

    DitherNoise at(double turn_hz, double place, double memory = 0.0, double asymmetry = 0.0) const {
        DitherNoise noise;
        noise.turn_hz = turn_hz;
        noise.place = place - 2.0 * std::floor(0.5 * place);
        noise.memory = memory;
        noise.asymmetry = asymmetry;
        noise.share = options.samples.turns.dither_first_share;
        if (notch_hz_ > 0.0) {
            // In half a cycle it learns a share of an amplitude.
            const double learnt = 1.0 - std::exp(-units::pi * notch_hz_ / turn_hz);
            noise.follower = {1.0 - learnt, 0.5 * learnt, 0.5 * learnt};
        } else if (path_with(memory) == Path::resonator) {
            // Turns of a damped resonator are late when its amplitude changes: v = -damping/2 times the changes, which
            // decay as the amplitude does.
            noise.follower = {memory, -memory, memory};
        }
        noise.rows = std::make_shared<const DitherRows>(rows_of(base_.series(), noise, notch_hz_ > 0.0));
        return noise;
    }

    /// From the start of the record.
    double middle_s() const { return 0.5 * base_.series().interval_s * static_cast<double>(base_.series().size()); }

    /// The most likely of several, each with the most likely of a few sizes of the white noises.
    DitherNoise best_of(std::vector<DitherNoise> all) const {
        std::vector<double> values(all.size());
        oneapi::tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t k) {
            const std::vector<double> each = SampleFilter::minus_log_likelihoods(
                sizes_with(all[k]), base_.series().interval_s, base_.rest(), base_.informative());
            values[k] = *std::min_element(each.begin(), each.end());
        });
        const auto best = std::min_element(values.begin(), values.end()) - values.begin();
        all[static_cast<std::size_t>(best)].gain = -values[static_cast<std::size_t>(best)];
        return all[static_cast<std::size_t>(best)];
    }

    /// The fit of the base model with this noise. Later comparisons start from its white noises.
    SampleFit fitted(DitherNoise& noise) {
        SampleModel model = base_.model();
        const auto sizes = sizes_with(noise);
        const std::vector<double> each =
            SampleFilter::minus_log_likelihoods(sizes, base_.series().interval_s, base_.rest(), base_.informative());
        model.noise = sizes[static_cast<std::size_t>(std::min_element(each.begin(), each.end()) - each.begin())];
        SampleFit fit(base_.series(), std::move(model), base_.rows(), SampleFit::Noise::free);
        whites_ = {fit.model().noise.angle_arcsec, fit.model().noise.rate_arcsec_rt_s};
        noise.larger = 1.0;
        return fit;
    }

   private:
    struct Whites {
        double angle_arcsec, rate_arcsec_rt_s;
    };

    /// The base model's noise with it, and white noises as in the last fit and somewhat smaller and larger. Before the
    /// first fit these are those of the base model, or the size of the innovations as that of the readings.
    std::vector<SampleNoise> sizes_with(const DitherNoise& noise) const {
        std::vector<Whites> whites;
        if (whites_) {
            for (const auto& [angle, rate] :
                 {std::pair{1.0, 1.0}, {1.0, 0.3}, {1.0, 3.0}, {0.85, 1.0}, {1.18, 1.0}, {0.85, 0.3}, {1.18, 3.0}}) {
                whites.push_back({angle * whites_->angle_arcsec, rate * whites_->rate_arcsec_rt_s});
            }
        } else {
            const double mean_share = 1.0 - 0.25 * noise.share;  // of the variance at the turns, over a half cycle
            const double own = base_.model().noise.angle_arcsec / std::sqrt(mean_share);
            const double typical = base_.typical_sd();
            for (const double angle : {own, 0.5 * typical, 0.8 * typical, 1.2 * typical}) {
                for (const double slower : {1.0, 0.3}) {
                    whites.push_back({angle, slower * base_.model().noise.rate_arcsec_rt_s});
                }
            }
        }
        std::vector<SampleNoise> all;
        for (const Whites& white : whites) {
            SampleNoise& with = all.emplace_back(base_.model().noise);
            take_dither_noise(noise, with);
            with.angle_arcsec = noise.larger * white.angle_arcsec;
            with.rate_arcsec_rt_s = white.rate_arcsec_rt_s;
        }
        return all;
    }

    const SampleFit& base_;
    double notch_hz_;
    std::optional<Whites> whites_;
};

bool has_dither_line(const SampleFit& fit, double dither_hz) {
    const double rate_hz = fit.series().rate_hz;
    const auto& columns = fit.model().columns;
    return std::any_of(columns.begin(), columns.end(), [&](const SampleColumn& column) {
        const double apart_hz = alias(column.track.hz, rate_hz).hz - alias(dither_hz, rate_hz).hz;
        return column.name == "cosine" && std::abs(apart_hz) < options.samples.declared_dither_error * dither_hz;
    });
}

/// The most likely of those one step of frequency, place or asymmetry away; other parameters are unchanged.
DitherNoise nearby(const Search& search, const DitherNoise& here, double hz_step, double place_step,
                   double asymmetry_step) {
    std::vector<DitherNoise> all;
    for (const double hz : {-1.0, 0.0, 1.0}) {
        for (const double place : {-1.0, 0.0, 1.0}) {
            for (const double asymmetry : {-1.0, 0.0, 1.0}) {
                DitherNoise there = search.at(here.turn_hz + hz * hz_step,
                                              here.place + place * place_step - hz * hz_step * search.middle_s(),
                                              here.memory, here.asymmetry + asymmetry * asymmetry_step);
                there.share = here.share;
                all.push_back(std::move(there));
            }
        }
    }
    return search.best_of(std::move(all));
}

}  // namespace

void take_dither_noise(const DitherNoise& found, SampleNoise& noise) {
    noise.sidebands = found.sidebands;
    if (!found.rows) return;
    noise.dither = found.rows;
    noise.dither_share = found.share;
    noise.dither_memory = found.memory;
    noise.dither_follower = found.follower;
}

namespace {

/// Injected noise by its amplitudes at the turns, which are drawn turn by turn or made by a resonator.
std::optional<DitherNoise> find_noise_of_turns(const SampleFit& base, const record::Record& record) {
    const reader::Settings& settings = record.reader->settings;
    const auto seen = turns_in_squares(base, record.declared);
    if (!seen) return std::nullopt;
    check_interrupt();
    const SampleTurnOptions& by = options.samples.turns;
    Search search(base, settings.stripping == reader::Stripping::notch ? settings.notch_bandwidth_hz : 0.0);
    const auto around = [&](double centre_hz, double half_width_hz, double step_hz, double centre, double half_width,
                            double step) {
        std::vector<DitherNoise> all;
        const auto hz_steps = static_cast<int>(std::lround(half_width_hz / step_hz));
        const auto place_steps = static_cast<int>(std::lround(half_width / step));
        for (int i = -hz_steps; i <= hz_steps; ++i) {
            const double hz = centre_hz + i * step_hz;
            // The place in the middle of the record is kept.
            for (int k = -place_steps; k <= place_steps; ++k) {
                all.push_back(search.at(hz, centre + k * step + (centre_hz - hz) * search.middle_s()));
            }
        }
        return search.best_of(std::move(all));
    };
    DitherNoise best = around(seen->turn_hz, 2.0 * seen->bin_hz, 0.5 * seen->bin_hz, 0.0, 0.5, 1.0 / 12.0);
    best = around(best.turn_hz, 0.4 * seen->bin_hz, 0.1 * seen->bin_hz, best.place, 0.06, 0.02);
    const auto vary_memory = [&](const auto& memories) {
        std::vector<DitherNoise> all;
        for (const double memory : memories) {
            all.push_back(search.at(best.turn_hz, best.place, memory, best.asymmetry));
            all.back().share = best.share;
            // The innovation at each turn is determined best: with a longer memory the amplitudes are larger.
            if (memory > 0.0 && best.memory > 0.0) {
                all.back().larger = std::sqrt((1.0 - best.memory * best.memory) / (1.0 - memory * memory));
            }
        }
        best = search.best_of(std::move(all));
    };
    const auto vary_share = [&] {
        std::vector<DitherNoise> all;
        for (const double share : by.dither_shares) {
            all.push_back(best);
            all.back().share = share;
        }
        best = search.best_of(std::move(all));
    };
    vary_memory(by.dither_memories);
    vary_share();
    best.gain = search.fitted(best).gain_over(base);
    // The smaller the other noises are, the more precisely the readings determine turns and memory.
    double place_step = by.dither_place_step;
    double asymmetry_step = by.dither_asymmetry_step;
    double hz_step = 0.1 * seen->bin_hz;
    for (int round = 0; round < by.dither_rounds; ++round) {
        const double before = best.gain;
        best = nearby(search, best, hz_step, place_step, asymmetry_step);
        place_step *= 0.5;
        asymmetry_step *= 0.5;
        hz_step *= 0.5;
        std::vector<double> memories{best.memory, 0.0};
        for (const double factor : {0.5, 0.8, 0.93, 1.07, 1.25, 2.0}) {
            memories.push_back(std::max(0.0, 1.0 - factor * (1.0 - best.memory)));
        }
        vary_memory(memories);
        vary_share();
        best.gain = search.fitted(best).gain_over(base);
        if (!(best.gain > before + by.dither_settled)) break;
    }
    if (best.gain < by.least_gain) return std::nullopt;
    return best;
}

/// Noise of the drive: sidebands of the dither as wide as the resonance of the dithered body.
std::optional<DitherNoise> find_sidebands(const SampleFit& base, double dither_hz) {
    const SampleTurnOptions& by = options.samples.turns;
    std::optional<DitherNoise> best;
    for (const double width : by.sideband_widths) {
        check_interrupt();
        SampleModel model = base.model();
        const double typical_arcsec = base.typical_sd();
        model.noise.sidebands = {by.sideband_first_rms * typical_arcsec, dither_hz, width * dither_hz};
        const SampleFit fit(base.series(), std::move(model), base.rows(), SampleFit::Noise::free);
        const double gain = fit.gain_over(base);
        const SampleNoise::Resonance& found = fit.model().noise.sidebands;
        // At another frequency it is not the noise of the dither, even if it explains the record well.
        const double tolerance_hz = found.width_hz + options.samples.declared_dither_error * dither_hz;
        if (std::abs(found.hz - dither_hz) > tolerance_hz) continue;
        if (gain < by.least_gain || (best && gain <= best->gain)) continue;
        best.emplace();
        best->gain = gain;
        best->turn_hz = 2.0 * dither_hz;
        best->sidebands = fit.model().noise.sidebands;
    }
    return best;
}

}  // namespace

std::optional<DitherNoise> find_dither_noise(const SampleFit& base, const record::Record& record) {
    using reader::Stripping;
    if (!record.reader || !record.declared.dither_frequency_hz) return std::nullopt;
    const Stripping stripping = record.reader->settings.stripping;
    if (stripping != Stripping::none && stripping != Stripping::notch) return std::nullopt;
    const double dither_hz = *record.declared.dither_frequency_hz;
    // The noise of the dither is far below the dither itself, whose line must be in the model first.
    if (stripping == Stripping::none && !has_dither_line(base, dither_hz)) return std::nullopt;
    auto of_turns = find_noise_of_turns(base, record);
    auto sidebands = find_sidebands(base, dither_hz);
    if (!of_turns || (sidebands && sidebands->gain > of_turns->gain)) return sidebands;
    return of_turns;
}

}  // namespace ringlock::closure
