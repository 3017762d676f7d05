#pragma once

#include <cstddef>

/// How often this program has asked for memory: malloc and its kin, operator new among them; under sanitizers operator
/// new alone. A test that asks links allocations.cpp, which replaces them.
std::size_t allocations_so_far();
