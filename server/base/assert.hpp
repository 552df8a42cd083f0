#pragma once

#include <cstdio>
#include <cstdlib>

/// Always on: a broken contract inside our own code is a bug, and going on would make it worse.
#define FIDUCAP_ASSERT(condition)                                                          \
  do {                                                                                     \
    if (!(condition)) {                                                                    \
      std::fprintf(stderr, "fiducap bug: %s does not hold, %s:%d\n", #condition, __FILE__, \
                   __LINE__);                                                              \
      std::abort();                                                                        \
    }                                                                                      \
  } while (false)
