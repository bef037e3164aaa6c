#include "analysis/closure/turns/fit/fitted.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>
#include <utility>

#include "analysis/closure/turns/model/effect_roles.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

namespace {

/// Noise of the dither at the turns [rad], estimated from the difference of successive swings of one sign, which holds
/// four of its values.
double injected_by_swings(const TurnSeries& series) {
    double squares = 0.0;
    for (std::size_t i = 0; i + 3 < series.size(); ++i) squares += std::pow(series.swing[i + 2] - series.swing[i], 2);
    return series.amplitude_rad * std::sqrt(squares / static_cast<double>(series.size()));
}

/// Linearises the model about the phases that the first fit estimates (the iterated Kalman smoother: Bell, SIAM Journal
/// on Optimization 4, 1994, 626). One pass is enough: the error of the first linearisation enters the next one squared.
void linearise_again(Fitted& fitted, const Rows& rows, TurnFit::Effects effects) {
    ReadingErrors known = fitted.fit->reading_errors();
    if (known.mean_rad.empty()) return;
    auto model = std::make_unique<TurnModel>(fitted.series(), fitted.joined().phase_rad, std::move(known));
    fitted.fit->release();
    fitted.fit = std::make_unique<TurnFit>(*model, fitted.fit->parameters(), rows, effects);
    fitted.model = std::move(model);
}

}  // namespace

TurnReading::TurnReading(const record::Record& record, const gyro::Ellipse& ellipse, bool count_again)
    : joined(join(*record.turns, ellipse, count_again)),
      series(prepare(record, joined)),
      model(series, joined.phase_rad) {}

/// The latest readings of a record: many candidates are fitted to one of them.
class TurnProblem::Readings {
   public:
    std::shared_ptr<const TurnReading> get(const record::Record& record, const gyro::Ellipse& ellipse,
                                           bool count_again) {
        const auto known = [&]() -> std::shared_ptr<const TurnReading> {
            for (const Entry& entry : latest_) {
                if (entry.ellipse == ellipse && entry.count_again == count_again) return entry.reading;
            }
            return nullptr;
        };
        {
            const std::lock_guard lock(mutex_);
            if (auto reading = known()) return reading;
        }
        const auto reading = std::make_shared<const TurnReading>(record, ellipse, count_again);
        const std::lock_guard lock(mutex_);
        if (auto other = known()) return other;
        latest_.push_front({ellipse, count_again, reading});
        if (latest_.size() > kept) latest_.pop_back();
        return reading;
    }

   private:
    static constexpr std::size_t kept = 4;
    struct Entry {
        gyro::Ellipse ellipse;
        bool count_again;
        std::shared_ptr<const TurnReading> reading;
    };
    std::mutex mutex_;
    std::deque<Entry> latest_;
};

TurnProblem::TurnProblem(const record::Record& record, Rows rows)
    : TurnProblem(record, std::move(rows), std::make_shared<Readings>()) {}

TurnProblem::TurnProblem(const record::Record& record, Rows rows, std::shared_ptr<Readings> readings)
    : record_(&record), rows_(std::move(rows)), readings_(std::move(readings)) {}

TurnProblem TurnProblem::whole() const { return {*record_, Rows(rows_.size(), 1), readings_}; }

std::shared_ptr<Fitted> TurnProblem::fit(const TurnParameters& start, TurnFit::Effects effects, double needed) const {
    check_interrupt();
    auto fitted = std::make_shared<Fitted>();
    gyro::Setup setup;
    bool count_again = false;
    for (const ActiveEffect& active : start.effects) {
        if (!changes_reading(*active.effect)) continue;
        active.effect->configure(active.values, setup);
        count_again |= effects::first_of(*active.effect, effects::Role::probability) != nullptr;
    }
    fitted->reading = readings_->get(*record_, setup.ellipse, count_again);
    const TurnModel& model = fitted->reading->model;
    TurnParameters parameters = start;
    const bool from_nothing = parameters.readout_sd_rad == 0.0;
    if (from_nothing) {
        parameters.readout_sd_rad = std::max(fitted->joined().readout_sd_rad, 1e-6);
        parameters.threshold_deg_h = fitted->series().setup.lockin_threshold_deg_h;
    }
    fitted->fit = std::make_unique<TurnFit>(model, parameters, rows_, effects, needed);
    if (from_nothing) {
        // Injected noise shows in the swings. A fit that starts without it may end at a lower maximum.
        parameters.injected_sd_rad = injected_by_swings(fitted->series());
        if (parameters.injected_sd_rad > parameters.readout_sd_rad) {
            fitted->fit->release();
            auto other = std::make_unique<TurnFit>(model, parameters, rows_, effects);
            if (other->log_likelihood() > fitted->log_likelihood()) fitted->fit = std::move(other);
        }
    }
    if (fitted->log_likelihood() > needed) linearise_again(*fitted, rows_, effects);
    return fitted;
}

std::shared_ptr<Fitted> TurnProblem::fit_or_none(const TurnParameters& start, double needed) const {
    try {
        return fit(start, TurnFit::Effects::fitted, needed);
    } catch (const RunError&) {
        return nullptr;
    }
}

}  // namespace ringlock::closure
