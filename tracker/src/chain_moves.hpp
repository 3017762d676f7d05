#pragma once

#include "tubetrack/tracker/recycled.hpp"
#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// Simpler chains that may do as well: without a bend whose angle, without a straight whose length, or with two
/// neighbouring bends made one whose distance and difference in plane, the nodes hardly tell from 0. The likeliest
/// first.
RecycledVector<PartChain> simpler_chains(const FittedChain& fitted);

}  // namespace tubetrack
