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
install(TARGETS ${client_targets} EXPORT fiducapTargets COMPONENT client
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${CMAKE_CURRENT_LIST_DIR}/../include/fiducap DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client)

set(client_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/fiducap)
install(EXPORT fiducapTargets NAMESPACE fiducap:: DESTINATION ${client_cmake_dir} COMPONENT client)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/fiducapConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfig.cmake INSTALL_DESTINATION ${client_cmake_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/fiducapConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
file(RELATIVE_PATH client_pc_up "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")  # so that the folder may be moved
configure_file(${CMAKE_CURRENT_LIST_DIR}/fiducap-client.pc.in ${CMAKE_CURRENT_BINARY_DIR}/fiducap-client.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/fiducapConfigVersion.cmake
  DESTINATION ${client_cmake_dir} COMPONENT client)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/fiducap-client.pc
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT client)
