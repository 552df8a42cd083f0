# find_package(fiducap) and pkg-config for whoever uses an installed client.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(client_targets fiducap_client)
if(FIDUCAP_CLIENT_SHARED)
  set(client_pc_libs "-lfiducap_client")
else()
  list(APPEND client_targets fiducap_proto)  # its objects are not inside a static library
  set(client_pc_libs "-lfiducap_client -lfiducap_proto -lprotobuf-lite -pthread")
endif()
# Two sets: whoever uses the C library need not have what the C++ one asks for.
set(client_places
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client NAMELINK_COMPONENT client
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client)
install(TARGETS fiducap_c EXPORT fiducapCTargets ${client_places})
install(TARGETS ${client_targets} EXPORT fiducapClientTargets ${client_places})
install(DIRECTORY ${CMAKE_CURRENT_LIST_DIR}/../include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client)

set(client_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/fiducap)
foreach(set C Client)
  install(EXPORT fiducap${set}Targets NAMESPACE fiducap:: DESTINATION ${client_cmake_dir} COMPONENT client)
endforeach()
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/fiducapConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfig.cmake INSTALL_DESTINATION ${client_cmake_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/fiducapConfigVersion.cmake
  VERSION ${PROJECT_VERSION} COMPATIBILITY SameMinorVersion)
file(RELATIVE_PATH client_pc_up "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")  # so that the folder may be moved
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfigVersion.cmake
  DESTINATION ${client_cmake_dir} COMPONENT client)
foreach(package fiducap-client fiducap)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/${package}.pc.in ${CMAKE_CURRENT_BINARY_DIR}/${package}.pc @ONLY)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${package}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT client)
endforeach()
