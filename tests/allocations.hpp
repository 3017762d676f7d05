#pragma once

#include <cstddef>

/// How often this program has called operator new. A test that asks links allocations.cpp, which replaces it.
std::size_t allocations_so_far();
