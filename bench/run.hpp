#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "figures.hpp"
#include "suite.hpp"

namespace tubetrack::bench {

/// Finds the tubes of a frame; one for each stream, so that it may remember.
using Detector = std::function<TubeFrame(const DepthFrame&)>;

/// A way to find tubes: tubetrack, or one of its peers.
struct Method {
  std::string name;
  std::function<Detector(const Intrinsics&)> start;
  bool follows = true;  ///< has identities from frame to frame; otherwise it is run on single frames alone
};

Method tubetrack_method();

struct RunOptions {
  DepthNoise noise;
  std::uint64_t first_seed = 1;
  int single_scenes = 5;
  int sequences = 0;
  int jobs = 1;                    ///< scenes at the same time; more than one disturbs the times
  double bound_piece_radii = 2.0;  ///< length of the pieces of the Cramér-Rao bound, in tube radii
};

/// One row by one method.
struct RowResult {
  Figures single;    ///< one frame of each scene, by a tracker that has seen nothing else
  Figures sequence;  ///< every frame of the sequences
  Figures last;      ///< their last frames alone
};

/// Every method on the same frames; in the order of `methods`. `progress` is called after every scene, by one
/// thread at a time.
std::vector<RowResult> run_row(const Row& row, const std::vector<Method>& methods, const RunOptions& options,
                               const std::function<void()>& progress);

}  // namespace tubetrack::bench
