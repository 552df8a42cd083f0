# The client alone: configured, built, installed, and used by a stranger's project by find_package and by pkg-config.
# cmake -D SOURCE=… -D WORK=… -P check.cmake
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
set(prefix ${WORK}/prefix)

function(run what)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${what} failed (${code}):\n${output}")
  endif()
  if(output MATCHES "warning:")
    message(FATAL_ERROR "${what} warns:\n${output}")
  endif()
endfunction()

foreach(shared OFF ON)
  set(alone ${WORK}/alone_${shared})
  string(TIMESTAMP begin "%s")
  run("configuring the client alone" ${CMAKE_COMMAND} -S ${SOURCE}/client -B ${alone} -DFIDUCAP_CLIENT_SHARED=${shared}
      -DCMAKE_INSTALL_LIBDIR=lib)
  run("building the client alone" ${CMAKE_COMMAND} --build ${alone} -j 4)
  string(TIMESTAMP end "%s")
  math(EXPR seconds "${end} - ${begin}")
  message(STATUS "client alone, shared ${shared}: ${seconds} s")
  file(READ ${alone}/CMakeCache.txt cache)
  if(cache MATCHES "OpenCV_DIR|Boost_DIR|Eigen3_DIR")
    message(FATAL_ERROR "the client alone looks for packages of the server")
  endif()
  run("installing" ${CMAKE_COMMAND} --install ${alone} --prefix ${prefix}_${shared})
  # The package may be moved.
  file(RENAME ${prefix}_${shared} ${WORK}/moved_${shared})
  set(moved ${WORK}/moved_${shared})

  set(stranger ${WORK}/stranger_${shared})
  run("find_package" ${CMAKE_COMMAND} -S ${SOURCE}/tests/interop/client_package -B ${stranger}
      -DCMAKE_PREFIX_PATH=${moved} "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wconversion -Wshadow -pedantic"
      "-DCMAKE_C_FLAGS=-Wall -Wextra -Wconversion -pedantic -std=c99")
  run("building with find_package" ${CMAKE_COMMAND} --build ${stranger})
  run("running the C++ stranger" ${stranger}/in_cpp)
  run("running the C stranger" ${stranger}/in_c)

  if(NOT shared)
    # Without protobuf's headers and CMake files, which a C project does not need.
    foreach(only "" c)
      set(stranger ${WORK}/stranger_in_c_${only})
      run("find_package in C (components: '${only}')" ${CMAKE_COMMAND}
          -S ${SOURCE}/tests/interop/client_package/c_only -B ${stranger} -DCMAKE_PREFIX_PATH=${moved} -DONLY=${only}
          -DCMAKE_DISABLE_FIND_PACKAGE_Protobuf=ON "-DCMAKE_C_FLAGS=-Wall -Wextra -pedantic -std=c99")
      run("building in C" ${CMAKE_COMMAND} --build ${stranger})
      run("running the program in C" ${stranger}/in_c)
    endforeach()
    execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE}/tests/interop/client_package/c_only -B ${WORK}/refused
      -DCMAKE_PREFIX_PATH=${moved} -DONLY=client -DCMAKE_DISABLE_FIND_PACKAGE_Protobuf=ON
      RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE output)
    if(code EQUAL 0 OR NOT output MATCHES "libprotobuf-dev")
      message(FATAL_ERROR "the C++ client without protobuf: expected a refusal with the remedy, came (${code}):\n${output}")
    endif()
  endif()

  find_program(PKG_CONFIG NAMES pkg-config pkgconf)
  if(NOT PKG_CONFIG)
    message(STATUS "pkg-config is not here: not checked")
    continue()
  endif()
  set(from ${SOURCE}/tests/interop/client_package)
  run("pkg-config, C++" sh -c "c++ -std=c++17 ${from}/stranger.cpp -o ${WORK}/pc_cpp $(PKG_CONFIG_PATH=${moved}/lib/pkgconfig ${PKG_CONFIG} --cflags --libs fiducap-client)")
  run("pkg-config, C" sh -c "cc ${from}/stranger.c -o ${WORK}/pc_c $(PKG_CONFIG_PATH=${moved}/lib/pkgconfig ${PKG_CONFIG} --cflags --libs fiducap)")
  run("running them" ${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=${moved}/lib sh -c "${WORK}/pc_cpp && ${WORK}/pc_c")
endforeach()
