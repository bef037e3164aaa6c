#include "analysis/closure/samples/fit/dither_noise.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/turn_pattern.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Weights of a reading between two turns: between them the dither's amplitude is linear in the cosine of its phase.
DitherRows rows_of(const SampleSeries& series, double turn_hz, double place, bool notched) {
    DitherRows rows;
    double before = 0.0;
    for (std::size_t i = 0; i < series.size(); ++i) {
        const double turns = turn_hz * series.interval_s * static_cast<double>(i + 1) + place;
        const double last = std::floor(turns);
        const double cosine = std::cos(units::pi * (turns - last));
        const double sign = std::fmod(last, 2.0) == 0.0 ? 1.0 : -1.0;
        rows.passed.push_back(static_cast<std::uint16_t>(last - before));
        rows.last.push_back(0.5 * sign * (1.0 + cosine));
        rows.next.push_back(-0.5 * sign * (1.0 - cosine));
        rows.notched.push_back(notched ? -sign * cosine : 0.0);
        before = last;
    }
    return rows;
}

class Search {
   public:
    Search(const SampleFit& base, double notch_hz) : base_(base), notch_hz_(notch_hz) {}

    DitherNoise at(double turn_hz, double place) const {
        DitherNoise noise;
        noise.turn_hz = turn_hz;
        noise.place = place - std::floor(place);
        noise.share = options.samples.turns.dither_first_share;
        noise.learnt = notch_hz_ > 0.0 ? 1.0 - std::exp(-units::pi * notch_hz_ / turn_hz) : 0.0;
        noise.rows = std::make_shared<const DitherRows>(rows_of(base_.series(), turn_hz, noise.place, notch_hz_ > 0.0));
        return noise;
    }

    /// From the start of the record.
    double middle_s() const { return 0.5 * base_.series().interval_s * static_cast<double>(base_.series().size()); }

    /// The likeliest of several, each with the likeliest of a few sizes of the white noises.
    DitherNoise best_of(std::vector<DitherNoise> all) const {
        std::vector<double> values(all.size());
        oneapi::tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t k) {
            const std::vector<double> each = SampleFilter::minus_log_likelihoods(
                sizes_with(all[k]), base_.series().interval_s, base_.rest(), base_.telling());
            values[k] = *std::min_element(each.begin(), each.end());
        });
        const auto best = std::min_element(values.begin(), values.end()) - values.begin();
        all[static_cast<std::size_t>(best)].gain = -values[static_cast<std::size_t>(best)];
        return all[static_cast<std::size_t>(best)];
    }

    /// The fit of the base model with it. Later comparisons start from its white noises.
    SampleFit fitted(const DitherNoise& noise) {
        SampleModel model = base_.model();
        const auto sizes = sizes_with(noise);
        const std::vector<double> each =
            SampleFilter::minus_log_likelihoods(sizes, base_.series().interval_s, base_.rest(), base_.telling());
        model.noise = sizes[static_cast<std::size_t>(std::min_element(each.begin(), each.end()) - each.begin())];
        SampleFit fit(base_.series(), std::move(model), base_.rows(), SampleFit::Noise::free);
        whites_ = {fit.model().noise.angle_arcsec, fit.model().noise.rate_arcsec_rt_s};
        return fit;
    }

   private:
    struct Whites {
        double angle_arcsec, rate_arcsec_rt_s;
    };

    /// The base model's noise with it, and white noises as of the last fit and somewhat smaller and larger; before the
    /// first fit those of the base model, or the innovations' size as that of the readings.
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
            with.angle_arcsec = white.angle_arcsec;
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
        const double apart_hz = alias(column.course.hz, rate_hz).hz - alias(dither_hz, rate_hz).hz;
        return column.name == "cosine" && std::abs(apart_hz) < options.samples.declared_dither_error * dither_hz;
    });
}

/// The likeliest of those a step of frequency or place away, all else as it is.
DitherNoise nearby(const Search& search, const DitherNoise& here, double hz_step, double place_step) {
    std::vector<DitherNoise> all;
    for (const double hz : {-1.0, 0.0, 1.0}) {
        for (const double place : {-1.0, 0.0, 1.0}) {
            DitherNoise there = search.at(here.turn_hz + hz * hz_step,
                                          here.place + place * place_step - hz * hz_step * search.middle_s());
            there.share = here.share;
            there.memory = here.memory;
            all.push_back(std::move(there));
        }
    }
    return search.best_of(std::move(all));
}

}  // namespace

void take_dither_noise(const DitherNoise& found, SampleNoise& noise) {
    noise.dither = found.rows;
    noise.dither_share = found.share;
    noise.dither_memory = found.memory;
    noise.dither_learnt = found.learnt;
}

std::optional<DitherNoise> find_dither_noise(const SampleFit& base, const record::Record& record) {
    using reader::Stripping;
    if (!record.reader || !record.declared.dither_frequency_hz) return std::nullopt;
    const reader::Settings& settings = record.reader->settings;
    if (settings.stripping != Stripping::none && settings.stripping != Stripping::notch) return std::nullopt;
    // The noise of the dither is far below the dither itself, whose line must be in the model first.
    if (settings.stripping == Stripping::none && !has_dither_line(base, *record.declared.dither_frequency_hz)) {
        return std::nullopt;
    }
    const auto seen = turns_in_squares(base, record.declared);
    if (!seen) return std::nullopt;
    check_interrupt();
    const SampleTurnOptions& by = options.samples.turns;
    Search search(base, settings.stripping == Stripping::notch ? settings.notch_bandwidth_hz : 0.0);
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
    const auto vary = [&](auto DitherNoise::*what, const auto& values) {
        std::vector<DitherNoise> all;
        for (const double value : values) {
            all.push_back(best);
            all.back().*what = value;
        }
        best = search.best_of(std::move(all));
    };
    vary(&DitherNoise::memory, by.dither_memories);
    vary(&DitherNoise::share, by.dither_shares);
    best.gain = search.fitted(best).gain_over(base);
    // The smaller the other noises are, the more precisely the readings determine turns and memory.
    double place_step = by.dither_place_step;
    double hz_step = 0.1 * seen->bin_hz;
    for (int round = 0; round < by.dither_rounds; ++round) {
        const double before = best.gain;
        best = nearby(search, best, hz_step, place_step);
        place_step *= 0.5;
        hz_step *= 0.5;
        std::vector<double> memories{best.memory, 0.0};
        for (const double factor : {0.5, 0.8, 1.25, 2.0}) {
            memories.push_back(std::max(0.0, 1.0 - factor * (1.0 - best.memory)));
        }
        vary(&DitherNoise::memory, memories);
        vary(&DitherNoise::share, by.dither_shares);
        best.gain = search.fitted(best).gain_over(base);
        if (!(best.gain > before + by.dither_settled)) break;
    }
    if (best.gain < by.least_gain) return std::nullopt;
    return best;
}

}  // namespace ringlock::closure
