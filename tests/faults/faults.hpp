// The faults that are tried on boothd as a process; those that need a kernel of their own are scenarios of the virtual booth.
#pragma once

#include <filesystem>
#include <random>
#include <string_view>
#include <vector>

#include "tests/faults/report.hpp"

namespace booth::tests {

struct FaultPlan {
  std::filesystem::path folder;  ///< empty and ours; what is left there tells what happened
  int times = 50;                ///< of faults at random moments
  int regions = 64;              ///< into which files are cut; one byte of each is changed at a time
  std::mt19937_64 random{1};
};

FaultRow killed(FaultPlan& plan);
FaultRow stopped(FaultPlan& plan);
FaultRow processor_stolen(FaultPlan& plan);
FaultRow memory_limit(FaultPlan& plan);
FaultRow full_disk(FaultPlan& plan);
FaultRow configuration_changed(FaultPlan& plan);
FaultRow model_changed(FaultPlan& plan);
FaultRow calibration_changed(FaultPlan& plan);
FaultRow sessions_changed(FaultPlan& plan);

struct Fault {
  std::string_view name;
  FaultRow (*run)(FaultPlan&);
};
const std::vector<Fault>& all_faults();

}  // namespace booth::tests
