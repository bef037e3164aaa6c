#pragma once
#include <memory>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// A record of a chain: the loop that has run on it, and the likelihood of its model at other rates of the source.
class RecordInChain {
   public:
    /// Runs the loop. Throws InputError with the record's name if the record does not suffice.
    RecordInChain(const NamedRecord& record, const Monitor& monitor);

    const Closure& alone() const { return alone_; }
    double rate_hz() const { return loop_->model_fit().series().rate_hz; }
    bool resampled() const { return loop_->resampled(); }
    /// Rate of the source that this record shows alone.
    double found_hz() const { return loop_->model_fit().model().noise.from_hz; }
    std::vector<double> other_hz() const { return loop_->other_sources_hz(); }
    const Estimate& found_rate() const { return found_rate_; }  ///< of all rows, as it is reported

    /// Fits the model with each of these rates of its source, and without any.
    void try_rates(const std::vector<double>& hz);
    /// For the last rates that were tried.
    const std::vector<double>& log_likelihood() const { return log_likelihood_; }
    double log_likelihood_without() const { return log_likelihood_without_; }
    /// The record's own rate near one of them.
    Estimate near(std::size_t rate) { return loop_->source_rate(models_[rate]); }

    /// The report with the source that all records share. The loop runs again where it had found a different source.
    Closure report_with(const KnownSource& source);

   private:
    std::shared_ptr<SampleFit> fitted_at(double hz) const;
    Closure noted(Closure closure) const;

    std::string name_;
    Monitor monitor_;
    std::string note_;  ///< on the summing of the record
    record::Record record_;
    std::unique_ptr<SampleLoop> loop_;
    Closure alone_;
    Estimate found_rate_;
    std::shared_ptr<SampleFit> without_;  ///< the model without its source
    std::vector<SampleModel> models_;
    std::vector<double> log_likelihood_;
    double log_likelihood_without_ = 0.0;
};

}  // namespace ringlock::closure
