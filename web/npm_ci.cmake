# Exactly the packages of package-lock.json; from npm's cache where it has them. No package's own script is run.
execute_process(
  COMMAND ${NPM} ci --ignore-scripts --prefer-offline --no-audit --no-fund --loglevel=error
  RESULT_VARIABLE failed OUTPUT_QUIET)
if(failed)
  message(FATAL_ERROR "npm ci failed. The page's packages are fetched once, so this needs the network (or a filled npm "
                      "cache). To build without the page: cmake --preset release -DFIDUCAP_WEB=OFF")
endif()
file(TOUCH ${PACKAGES})
