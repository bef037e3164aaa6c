#include "analysis/closure/chain/record_in_chain.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <utility>

#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock::closure {

RecordInChain::RecordInChain(const NamedRecord& record, const Monitor& monitor)
    : name_(record.name),
      monitor_{[this, monitor](const std::string& stage) { monitor.tell(name_ + ": " + stage); }},
      record_(summed_for_reader(*record.record, note_)) {
    try {
        loop_ = std::make_unique<SampleLoop>(record_, monitor_);
        alone_ = noted(loop_->run());
        if (resampled()) found_rate_ = loop_->source_rate(loop_->model_fit().model());
    } catch (const InputError& error) {
        throw InputError(fmt::format("{}: {}", name_, error.what()));
    }
}

Closure RecordInChain::noted(Closure closure) const {
    if (!note_.empty()) closure.notes.insert(closure.notes.begin(), note_);
    return closure;
}

/// Returns the model with a source of that rate. Its noise is fitted again, as in a record that is closed alone.
std::shared_ptr<SampleFit> RecordInChain::fitted_at(double hz) const {
    check_interrupt();
    const SampleFit& found = loop_->model_fit();
    const SampleSeries& series = found.series();
    const auto fitted = [&](SampleModel model) {
        return std::make_shared<SampleFit>(series, std::move(model), found.rows(), SampleFit::Noise::free);
    };
    if (found.model().noise.from_hz > 0.0) {
        if (same_source(hz, found_hz(), series.rate_hz)) return std::make_shared<SampleFit>(found);
        for (const SamePattern& pattern : with_same_pattern(found_hz(), series.rate_hz)) {
            if (!same_source(hz, pattern.hz, series.rate_hz)) continue;
            SampleNoise noise = found.model().noise;
            noise.from_hz = pattern.hz;
            noise.from_phase = phase_of(pattern, found.model().noise.from_phase);
            noise.resonances = without_->model().noise.resonances;  // where the record shows them
            return fitted(resampled_with(*without_, noise));
        }
    }
    std::shared_ptr<SampleFit> best;
    for (SampleModel& model : models_of_source(*without_, hz)) {
        auto fit = fitted(std::move(model));
        if (!best || fit->log_likelihood() > best->log_likelihood()) best = std::move(fit);
    }
    return best;
}

void RecordInChain::try_rates(const std::vector<double>& hz) {
    monitor_.tell("fitting rates of the source");
    const SampleFit& found = loop_->model_fit();
    without_ = found.model().noise.from_hz > 0.0
                   ? std::make_shared<SampleFit>(found.series(), without_source(found), found.rows())
                   : std::make_shared<SampleFit>(found);
    models_.resize(hz.size());
    log_likelihood_.resize(hz.size());
    oneapi::tbb::parallel_for(std::size_t{0}, hz.size(), [&](std::size_t k) {
        const auto fit = fitted_at(hz[k]);
        models_[k] = fit->model();
        log_likelihood_[k] = loop_->log_likelihood(*fit);
    });
    log_likelihood_without_ = loop_->log_likelihood(*without_);
}

Closure RecordInChain::report_with(const KnownSource& source) {
    if (resampled() && same_source(source.from_hz, found_hz(), rate_hz())) {
        monitor_.tell("fitting with the shared source");
        return noted(loop_->report_with(source));
    }
    monitor_.tell("running the loop again with the shared source");
    return noted(SampleLoop(record_, monitor_, source).run());
}

}  // namespace ringlock::closure
