// --seed of every verb that takes one, with the range of the key fit.seed: what one verb or boothd wrote down, another takes.
#pragma once

namespace CLI {
class Option;
}

namespace booth::daemon {

/// Makes an option one of a seed: it takes whole numbers from 0 to what a reader of JSON still holds exactly, and says its default. Returns it.
CLI::Option* as_seed(CLI::Option* option);

}  // namespace booth::daemon
