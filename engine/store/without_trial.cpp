#include "engine/store/without_trial.hpp"

namespace ringlock::store {
namespace {

bool is_off = false;

}  // namespace

WithoutTrial::WithoutTrial() : before_(is_off) { is_off = true; }
WithoutTrial::~WithoutTrial() { is_off = before_; }
bool is_without_trial() { return is_off; }

}  // namespace ringlock::store
