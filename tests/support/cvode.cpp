#include "tests/support/cvode.hpp"

#include <cvode/cvode.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <string>
#include <type_traits>

#include "engine/core/error.hpp"
#include "tests/support/deviation.hpp"

namespace ringlock::test {

namespace {

// Each handle of SUNDIALS is freed by a function of its own that takes its address or its value.
struct FreeContext {
    void operator()(SUNContext context) const { SUNContext_Free(&context); }
};
struct FreeVector {
    void operator()(N_Vector vector) const { N_VDestroy(vector); }
};
struct FreeIteration {
    void operator()(SUNNonlinearSolver iteration) const { SUNNonlinSolFree(iteration); }
};
struct FreeMemory {
    void operator()(void* memory) const { CVodeFree(&memory); }
};

using Context = std::unique_ptr<std::remove_pointer_t<SUNContext>, FreeContext>;
using Vector = std::unique_ptr<std::remove_pointer_t<N_Vector>, FreeVector>;
using Iteration = std::unique_ptr<std::remove_pointer_t<SUNNonlinearSolver>, FreeIteration>;
using Memory = std::unique_ptr<void, FreeMemory>;

Context make_context() {
    SUNContext context = nullptr;
    if (SUNContext_Create(nullptr, &context) != 0) throw RunError("CVODE: no context");
    return Context(context);
}

template <class Handle>
Handle* not_null(Handle* handle, const char* what) {
    if (handle == nullptr) throw RunError(fmt::format("CVODE: {} failed", what));
    return handle;
}

// A half cycle of 2000 fringes takes some 1e5 steps at the tightest tolerance that double precision allows.
constexpr long most_steps = 20'000'000;

}  // namespace

struct Cvode::Solver {
    Solver(gyro::Coupling its_coupling, double its_longest_step_fringes)
        : coupling(its_coupling),
          longest_step_fringes(its_longest_step_fringes),
          context(make_context()),
          deviation(not_null(N_VNew_Serial(1, context.get()), "N_VNew_Serial")),
          iteration(not_null(SUNNonlinSol_FixedPoint(deviation.get(), 0, context.get()), "SUNNonlinSol_FixedPoint")),
          memory(not_null(CVodeCreate(CV_ADAMS, context.get()), "CVodeCreate")) {}

    double& value() const { return *NV_DATA_S(deviation.get()); }

    void check(int status, const char* what) const {
        if (status >= 0) return;
        throw RunError(fmt::format("CVODE: {} failed ({}): {}", what, status, message));
    }

    static int rate(double t_s, N_Vector x, N_Vector rate_of_x, void* data) {
        const auto& self = *static_cast<const Solver*>(data);
        *NV_DATA_S(rate_of_x) = self.equation->rate_rad_s(t_s, *NV_DATA_S(x));
        return 0;
    }

    /// Keeps the last message for the exception; CVODE would print it.
    static void keep_message(int /*code*/, const char* /*module*/, const char* /*function*/, char* text, void* data) {
        static_cast<Solver*>(data)->message = text;
    }

    gyro::Coupling coupling;
    const Deviation* equation = nullptr;  // of the half cycle that is being integrated
    double longest_step_fringes;
    std::string message;
    std::int64_t evaluations = 0;
    // In the order in which they may be made; taken down from the last.
    Context context;
    Vector deviation;
    Iteration iteration;
    Memory memory;
};

Cvode::Cvode(gyro::Coupling coupling, double tolerance_rad, double relative_tolerance, double longest_step_fringes)
    : solver_(std::make_unique<Solver>(coupling, longest_step_fringes)) {
    Solver& s = *solver_;
    void* memory = s.memory.get();
    s.check(CVodeSetErrHandlerFn(memory, Solver::keep_message, &s), "CVodeSetErrHandlerFn");
    s.value() = 0.0;
    s.check(CVodeInit(memory, Solver::rate, 0.0, s.deviation.get()), "CVodeInit");
    s.check(CVodeSetUserData(memory, &s), "CVodeSetUserData");
    s.check(CVodeSStolerances(memory, relative_tolerance, tolerance_rad), "CVodeSStolerances");
    s.check(CVodeSetNonlinearSolver(memory, s.iteration.get()), "CVodeSetNonlinearSolver");
    s.check(CVodeSetMaxNumSteps(memory, most_steps), "CVodeSetMaxNumSteps");
}

Cvode::~Cvode() = default;

double Cvode::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) {
    Solver& s = *solver_;
    void* memory = s.memory.get();
    const Deviation equation(s.coupling, half, phase_rad);
    s.equation = &equation;
    s.value() = 0.0;
    const double longest_s = s.longest_step_fringes * units::two_pi / equation.fastest_rad_s();
    s.check(CVodeReInit(memory, 0.0, s.deviation.get()), "CVodeReInit");
    s.check(CVodeSetMaxStep(memory, longest_s), "CVodeSetMaxStep");
    s.check(CVodeSetStopTime(memory, half.duration_s), "CVodeSetStopTime");
    double reached_s = 0.0;
    s.check(CVode(memory, half.duration_s, s.deviation.get(), &reached_s, CV_NORMAL), "CVode");
    long evaluations = 0;
    s.check(CVodeGetNumRhsEvals(memory, &evaluations), "CVodeGetNumRhsEvals");
    s.evaluations += evaluations;
    return s.value();
}

std::int64_t Cvode::evaluations() const { return solver_->evaluations; }

}  // namespace ringlock::test
