# After a test program is built: writes what ctest runs of it, one entry per suite. A program starts in a third of a
# second (its libraries are many), which is more than most tests take, so entries of single tests would double the
# time. Suites of which a test may be skipped are listed test by test: a skipped one is seen as that, and one that
# hides in a suite fails it. WHOLE: one entry for the program, as under sanitizers, where it starts in seconds; what is
# skipped there the usual build tells.
#
#   cmake -D PROGRAM=… -D SOURCES=…;… -D LIST=… -D LABELS=…;… [-D WHOLE=ON] -P discover_suites.cmake
cmake_minimum_required(VERSION 3.25)
get_filename_component(program ${PROGRAM} NAME)
if(WHOLE)
  file(WRITE ${LIST} "add_test([=[${program}]=] [=[${PROGRAM}]=])\n"
    "set_tests_properties([=[${program}]=] PROPERTIES LABELS [=[${LABELS}]=] TIMEOUT 600)\n")
  return()
endif()
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed RESULT_VARIABLE failed TIMEOUT 120)
if(failed)
  message(FATAL_ERROR "${PROGRAM} does not list its tests: ${failed}")
endif()

set(apart "")
foreach(source ${SOURCES})
  file(STRINGS ${source} skips REGEX "GTEST_SKIP")
  if(skips)
    file(STRINGS ${source} tests REGEX "^ *(TYPED_)?TEST(_F|_P)?\\(")
    foreach(test ${tests})
      string(REGEX REPLACE ".*TEST[_A-Z]*\\(([^,]+),.*" "\\1" suite "${test}")
      list(APPEND apart ${suite})
    endforeach()
  endif()
endforeach()

set(content "")
# entry(TEST PROPERTY): what a test that says it was skipped is.
function(entry test skipped)
  string(APPEND content "add_test([=[${program}.${test}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${test}]=])\n"
    "set_tests_properties([=[${program}.${test}]=] PROPERTIES LABELS [=[${LABELS}]=] TIMEOUT 600 "
    "${skipped} [=[\\[  SKIPPED \\]]=])\n")
  set(content "${content}" PARENT_SCOPE)
endfunction()

string(REPLACE ";" "," listed "${listed}")
string(REPLACE "\n" ";" lines "${listed}")
foreach(line ${lines})
  string(REGEX REPLACE " *#.*" "" line "${line}")
  if(line MATCHES "^([^ ]+)\\.$")
    set(suite ${CMAKE_MATCH_1})
    string(REPLACE "/" ";" parts ${suite})
    set(is_apart FALSE)
    foreach(part ${parts})
      if(part IN_LIST apart)
        set(is_apart TRUE)
      endif()
    endforeach()
    if(NOT is_apart AND NOT suite MATCHES "^DISABLED_|/DISABLED_")
      entry("${suite}.*" FAIL_REGULAR_EXPRESSION)
    endif()
  elseif(line MATCHES "^  ([^ ]+)$" AND is_apart AND NOT line MATCHES "DISABLED_")
    string(STRIP "${line}" test)
    entry("${suite}.${test}" SKIP_REGULAR_EXPRESSION)
  endif()
endforeach()
file(WRITE ${LIST} "${content}")
