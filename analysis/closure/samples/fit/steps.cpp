#include "analysis/closure/samples/fit/steps.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"

namespace ringlock::closure {

namespace {

std::vector<double> step_at(const SampleSeries& series, std::size_t row) {
    std::vector<double> values(series.size(), 0.0);
    std::fill(values.begin() + static_cast<std::ptrdiff_t>(row), values.end(), series.interval_s);
    return values;
}

}  // namespace

SampleColumn step_column(const effects::Effect& effect, const SampleSeries& series, std::size_t row) {
    return {.effect = &effect,
            .name = std::string(parameter_of(effect, effects::Role::size).name),
            .series = std::make_shared<const std::vector<double>>(step_at(series, row))};
}

bool is_step(const SampleColumn& column) {
    return column.effect != nullptr && on_samples(*column.effect) == OnSamples::step;
}

double root_of_step(const SampleFit& fit, std::size_t row) {
    const auto score = fit.score({fit.as_taken(step_at(fit.series(), row))});
    return score.rank == 0 ? 0.0 : std::copysign(std::sqrt(score.chi2), score.value[0]);
}

std::optional<Jump> jump_with_random_rate(const SampleFit& fit) {
    if (!fit.model().walk && !fit.model().flicker) return std::nullopt;
    const std::vector<double> step = step_at(fit.series(), fit.series().size() / 2);
    return largest_jump(fit.innovations(), fit.rows(), fit.filter().apply(step));
}

std::size_t refine_place(const SampleFit& without, std::size_t row, std::size_t reach) {
    // Nearer to an end a step is hardly distinguished from the start or the end of the record.
    const std::size_t first = std::max<std::size_t>(1, without.series().size() / options.samples.fit.positions_of_step);
    const std::size_t last = without.series().size() - 1 - first;
    double best = std::abs(root_of_step(without, row));
    for (std::size_t d = reach; d > 0; d /= 2) {
        for (const std::size_t at : {std::max(first, row - std::min(row, d)), std::min(last, row + d)}) {
            const double root = std::abs(root_of_step(without, at));
            if (root <= best) continue;
            best = root;
            row = at;
        }
    }
    return row;
}

namespace {

SampleFit without_column(const SampleFit& fit, std::size_t column, const Rows& rows) {
    SampleModel model = fit.model();
    model.columns.erase(model.columns.begin() + static_cast<std::ptrdiff_t>(column));
    return {fit.series(), std::move(model), rows, SampleFit::Noise::held};
}

SampleFit with_place(const SampleFit& fit, std::size_t column, std::size_t row, const Rows& rows) {
    SampleModel model = fit.model();
    model.columns[column].series = std::make_shared<const std::vector<double>>(step_at(fit.series(), row));
    return {fit.series(), std::move(model), rows, SampleFit::Noise::near};
}

}  // namespace

std::size_t row_of_step(const SampleColumn& step) {
    const auto& values = *step.series;
    return static_cast<std::size_t>(std::find_if(values.begin(), values.end(), [](double x) { return x != 0.0; }) -
                                    values.begin());
}

SampleFit refine_steps(SampleFit fit, const Rows& rows) {
    for (int round = 0; round < options.samples.fit.most_step_rounds; ++round) {
        bool moved = false;
        for (std::size_t k = 0; k < fit.model().columns.size(); ++k) {
            if (!is_step(fit.model().columns[k])) continue;
            const std::size_t row = row_of_step(fit.model().columns[k]);
            const std::size_t at = refine_place(without_column(fit, k, rows), row,
                                                fit.series().size() / (2 * options.samples.fit.positions_of_step));
            if (at == row) continue;
            moved = true;
            fit = with_place(fit, k, at, rows);
        }
        if (!moved) break;
    }
    return fit;
}

SampleFit place_in_gaps(SampleFit fit, const Rows& rows, const Rows& known) {
    const std::size_t positions = options.samples.fit.positions_in_gap;
    for (std::size_t k = 0; k < fit.model().columns.size(); ++k) {
        if (!is_step(fit.model().columns[k])) continue;
        const std::size_t row = row_of_step(fit.model().columns[k]);
        std::size_t from = row;
        std::size_t to = row;
        while (from > 1 && !rows[from - 1]) --from;
        while (to + 2 < rows.size() && !rows[to]) ++to;
        if (from == to) continue;
        Rows all = rows;
        for (std::size_t i = from; i < to; ++i) all[i] = known[i];
        const SampleFit without = without_column(fit, k, all);
        std::size_t at = row;
        double most = 0.0;
        for (std::size_t p = 0; p <= positions; ++p) {
            const std::size_t place = from + (to - from) * p / positions;
            const double root = std::abs(root_of_step(without, place));
            if (root > most) at = place;
            most = std::max(most, root);
        }
        at = refine_place(without, at, std::max<std::size_t>(1, (to - from) / (2 * positions)));
        if (at != row) fit = with_place(fit, k, at, rows);
    }
    return fit;
}

}  // namespace ringlock::closure
