// The long form of the refinement: to the end, and where nothing is wrong.
#include <gtest/gtest.h>

#include <iostream>

#include "tests/daemon/drift/refinement_scene.hpp"

namespace booth::tests {
namespace {

TEST(PersonRefinementLong, PutsRightWhatWasKnockedAndLate) { put_right("showcase", 30, 5, 0.25); }

TEST(PersonRefinementLong, LeavesAloneWhatIsRight) {
  const auto input = input_of("showcase", 30, {});
  const daemon::PersonRefinement r = daemon::refine_from_person(input);
  std::cout << r.sentence << "\n";
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_LT(error_at_stage(r.cameras[c], input.cameras[c]), 0.004) << c;
    EXPECT_NEAR(r.change[c].late, 0, 0.002) << c;
  }
}

}  // namespace
}  // namespace booth::tests
