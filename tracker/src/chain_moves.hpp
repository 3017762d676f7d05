#pragma once

#include "tubetrack/tracker/part_chain.hpp"

namespace tubetrack {

/// Chains with one bend less that may do as well: without a bend that turns little, or with two neighbours made one
/// that turn nearly the same way with little between them. The likeliest first.
std::vector<PartChain> simpler_chains(const PartChain& chain, double tube_radius_m);

}  // namespace tubetrack
