#pragma once

#include "tubetrack/tracker/segments.hpp"

namespace tubetrack {

/// Chains with one bend less that may do as well: without a bend whose angle, or with two neighbours made one whose
/// distance and difference in plane, the nodes hardly tell from 0. The likeliest first.
std::vector<PartChain> simpler_chains(const FittedChain& fitted);

}  // namespace tubetrack
