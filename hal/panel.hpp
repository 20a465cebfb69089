// What hangs on the wall beside the stage: buttons, a light, perhaps a buzzer, and what is wrong with them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/status_light.hpp"
#include "hal/trigger.hpp"

namespace booth::hal {

/// What a buzzer says; docs/guide/buttons-and-light.md says how it sounds.
enum class Sound : std::uint8_t { accepted, refused, countdown, found, ended };

/// A panel survives its devices: a missing chip, a busy line or one that vanishes is a problem that is told, and tried again until it is gone.
class Panel : public Trigger, public StatusLight {
 public:
  /// Thread-safe; returns at once. A sound that is still playing is cut off. Silent where there is no buzzer.
  virtual void play(Sound sound) = 0;
  /// One sentence for each thing that a person should look after; empty when all is well. Thread-safe.
  virtual std::vector<std::string> problems() const = 0;
  /// Moves as long as the panel is alive, for a watchdog. Thread-safe.
  virtual std::uint64_t progress() const = 0;
};

}  // namespace booth::hal
