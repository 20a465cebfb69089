// What the light shows: the worst thing first, then what the visitor asks (may I, wait, now, where are you).
#include "daemon/session/light_rule.hpp"

namespace booth::daemon {
namespace {

hal::LightPattern pattern_of(const LightFacts& facts) {
  switch (facts.state) {
    case SessionState::idle:
      return hal::LightPattern::idle_steady;
    case SessionState::estimating:
      return hal::LightPattern::estimating_fast_blink;
    case SessionState::tracking:
      return hal::LightPattern::tracking_on;
    case SessionState::searching:
      return hal::LightPattern::searching_slow_blink;
    case SessionState::finishing:
      return hal::LightPattern::saving_flash;
    case SessionState::countdown:
      return hal::LightPattern::countdown_double_blink;
    case SessionState::calibrating:
      return light_of(facts.cue);
  }
  return hal::LightPattern::off;
}

}  // namespace

FaultCode fault_of(const LightFacts& facts) {
  if (facts.latched) return FaultCode::emergency_stop;
  if (facts.paused) return FaultCode::too_few_cameras;
  if (facts.alarm) return FaultCode::not_saved;
  if (facts.panel) return FaultCode::panel;
  return FaultCode::none;
}

hal::LightShow light_of(const LightFacts& facts) {
  const FaultCode fault = fault_of(facts);
  const bool stops = fault == FaultCode::emergency_stop || fault == FaultCode::too_few_cameras;
  // While files are written nothing is asked of the visitor but to wait.
  const bool shown = fault != FaultCode::none && (facts.state == SessionState::idle || (stops && facts.state != SessionState::finishing));
  if (shown) return {.pattern = hal::LightPattern::fault_code, .code = static_cast<int>(fault), .degraded = false};
  return {.pattern = pattern_of(facts), .code = 0, .degraded = facts.degraded || fault != FaultCode::none};
}

}  // namespace booth::daemon
