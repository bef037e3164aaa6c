#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/rows.hpp"
#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/samples/fit/figures.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/score.hpp"
#include "analysis/closure/samples/loop/contest.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/samples/residual/tests.hpp"
#include "analysis/closure/samples/rounded/rounded.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The closed loop on one record of samples: its steps are in run.cpp, the growth of the model in grow.cpp, and the
/// tests of the residual in left.cpp.
class SampleLoop {
   public:
    /// \param source  source of the record, if known from other records: no other is searched then
    explicit SampleLoop(const record::Record& record, const Monitor& monitor = {},
                        std::optional<KnownSource> source = {})
        : record_(record),
          monitor_(monitor),
          source_(std::move(source)),
          series_(prepared(record)),
          rounded_(series_),
          chosen_(training_rows(series_.size())) {}

    Closure run();
    Closure fit(const std::vector<ActiveEffect>& effects);

    // The following functions are for a loop that has run.
    /// The final model, fitted to the training rows.
    const SampleFit& model_fit() const { return *now_.fit; }
    /// Log-likelihood of a model of these rows; with values in coarse steps, that of the measured increments.
    double log_likelihood(const SampleFit& fit) const { return score(fit).log_likelihood; }
    /// Whether that model has a source that is reported.
    bool resampled() const;
    /// Rates that explain the record as well as that source.
    std::vector<double> other_sources_hz() const;
    /// The rate of the source by this record alone: fitted to all rows that are to count, from a nearby model.
    Estimate source_rate(const SampleModel& from);
    /// The report if the source has that rate, which is near the one found: it is held, and all other parameters are
    /// fitted again. The residual was tested with the rate from this record alone, which differs by chance only.
    Closure report_with(const KnownSource& source);

   private:
    static SampleSeries prepared(const record::Record& record) {
        SampleSeries series = prepare_samples(record);
        series.dither_left = leaves_dither_noise(record);
        series.count_noise_arcsec = closure::count_noise_arcsec(record);
        series.whole_cycles = record.reader && record.reader->settings.stripping == reader::Stripping::whole_cycle;
        series.cycle_counts = series.whole_cycles && record.reader->settings.fraction == reader::Fraction::none;
        return series;
    }
    /// The model with the effects that were added to it.
    struct State {
        std::shared_ptr<SampleFit> fit;
        std::vector<AddedEffect> added;
        std::vector<double> lines_hz;
        std::vector<std::string> notes;  ///< on these steps
        Partners of_partners;            ///< of all choices
    };
    /// Step of the values as fits and tests see it; imputed increments have a negligible one.
    double lattice_step() const {
        if (rounded_.drawn()) return 1e-9 * rounded_.step_arcsec();
        return counted_step() > 0.0 ? counted_step() : lattice_.step_arcsec;
    }
    double counted_step() const { return series_.counted ? 0.25 * series_.scale_factor_arcsec : 0.0; }
    /// The step of the lattice as the parameter of an effect.
    Estimate step_of_lattice(const effects::Effect& effect) const {
        const auto& step = parameter_of(effect, effects::Role::sampled);
        return estimate_of(effect, step.name, lattice_.step_arcsec, lattice_.step_sd_arcsec);
    }
    std::vector<double> chosen_increments() const;
    Rows all_rows() const;
    void take_disturbed(Closure& closure) const;
    void take_gaps(Closure& closure) const;
    std::shared_ptr<SampleFit> fit_base(Closure& closure) const;
    std::shared_ptr<SampleFit> with_turns(const SampleFit& fit, Closure& closure) const;
    void find_turns_again(Closure& closure);
    void begin(Closure& closure);
    void close(Closure& closure);
    void take_known(const std::vector<ActiveEffect>& effects, Closure& closure);
    void add_all(Closure& closure, bool random_rates);
    void begin_again(const State& at);
    void go_without_random(Closure& closure);
    void look_behind_placeholder(Closure& closure);
    bool keep_names(int first_id, const std::function<bool(const AddedEffect&)>& keeps, Closure& closure);
    Disturbed still_disturbed() const;
    bool restore();
    void take_lattice(Closure& closure);
    const SampleCandidate& take_likelier(const SampleChoice& choice, Step& step);
    void take(const SampleChoice& choice, Closure& closure);
    void take_back_lines(Closure& closure);
    void move_case(AddedEffect& motion, SampleFit::Noise noise);
    bool move_anew();
    struct Stripped {
        SampleModel model;
        int parameters = 1;  ///< number of parameters that were removed
    };
    std::optional<Stripped> stripped(const AddedEffect& of, const effects::Effect& last) const;
    void drop_needless(const effects::Effect& last);
    void test_what_is_left(Closure& closure) const;
    void test_left_out(Closure& closure) const;
    void finish(Closure& closure);

    void find_coarse_steps(Closure& closure);
    SampleScore score(const SampleFit& fit) const;
    SampleFigures figures_from(const SampleModel& model, const std::vector<AddedEffect>& added);

    const record::Record& record_;
    const Monitor monitor_;
    const std::optional<KnownSource> source_;
    SampleSeries series_;
    RoundedSamples rounded_;
    Rows chosen_;
    Rows rows_;  ///< training rows that are not disturbed
    Rows reported_;
    Rows whole_;
    Disturbed disturbed_;
    Lattice lattice_;
    double used_step_ = 0.0;  ///< of the lattice in the model
    std::shared_ptr<SampleFit> base_;
    State now_;
    std::optional<State> earlier_;              ///< before the first random rate
    std::shared_ptr<SampleCandidate> nearest_;  ///< placeholder of the last choice, which had nothing to add
    int next_id_ = 0;                           ///< step of the next effect that is added
    Closure tested_;                            ///< result of the loop before its parameters are filled in
};

/// Runs the loop on a record of samples. Throws InputError if the record does not suffice.
Closure close_samples(const record::Record& record, const Monitor& monitor = {});

/// The model with these effects fitted, without any search; the residual is not tested. The fit starts from the given
/// values of the effects.
Closure fit_samples(const record::Record& record, const std::vector<ActiveEffect>& effects);

}  // namespace ringlock::closure
