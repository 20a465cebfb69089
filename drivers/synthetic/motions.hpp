// Motions that the project writes itself, as smooth curves over the degrees of freedom: no pose database has seen them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "drivers/synthetic/motion.hpp"

namespace booth::drivers {

/// walk, turn, wave, kick, squat, roll-hands, jump, a-pose, left-arm (only the left arm raised) and showcase (all of them in one sequence).
std::vector<std::string_view> motion_names();

/// `seconds` > 0 sets the length; 0 takes the motion's own. All but walk are cyclic. The body stands at the centre of the stage and faces
/// +x of the booth frame; q[1] puts the lowest foot of `contact` on the floor in each frame (a jump leaves it).
/// Throws std::invalid_argument with the known names.
Motion motion_by_name(std::string_view name, double seconds, const Contact& contact);

}  // namespace booth::drivers
