# The farm, its controller and its command line in one image.  `docker build -t pnfarm .`
#
# `--build-arg BASE=debian:bookworm-slim@sha256:<digest>` builds on exactly that base image; `--build-arg VERSION=...` and
# `--build-arg REVISION=...` become its labels.
# Builds with BuildKit and with the classic builder alike.  Behind a proxy with a certificate authority of its own:
# `--build-arg PIP_CERT=<path in the base image>`, `--build-arg PIP_INDEX_URL=...`; neither stays in the image.

ARG BASE=debian:bookworm-slim

FROM ${BASE} AS build
ARG PIP_CERT
ARG PIP_INDEX_URL
ARG SOURCE_DATE_EPOCH
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates python3 python3-venv \
 && rm -rf /var/lib/apt/lists/*

# Dependencies change seldom: a layer of their own.  Every package has the version of locks/ and is checked by its hash;
# the build tools stay out of the image.
WORKDIR /src
COPY locks locks
RUN python3 -m venv /opt/pnfarm \
 && python3 -m venv /opt/build \
 && /opt/pnfarm/bin/pip install --no-cache-dir --disable-pip-version-check --require-hashes -r locks/runtime.txt \
 && /opt/build/bin/pip install --no-cache-dir --disable-pip-version-check --require-hashes -r locks/build.txt

COPY pyproject.toml hatch_build.py README.md LICENSE LICENSES.md ./
COPY pnfarm pnfarm
RUN /opt/build/bin/pip wheel --no-cache-dir --disable-pip-version-check --no-deps --no-build-isolation --no-index \
      --wheel-dir /wheels . \
 && /opt/pnfarm/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps --no-index /wheels/*.whl \
 && /opt/pnfarm/bin/pip uninstall -y --disable-pip-version-check setuptools pip

# The engine's machine code, compiled once, for any processor of this architecture, unless the build's context has it
# (`python -m pnfarm.engine.warm --copy-to pnfarm/machine_code`).  Any user loads it, none replaces it.
ENV NUMBA_CACHE_DIR=/opt/pnfarm/cache
# not in /src: what is compiled must be what was installed
WORKDIR /
RUN mkdir /opt/pnfarm/cache \
 && find /opt/pnfarm/lib -name '*.py' -exec touch --no-create --date=@1700000000 {} + \
 && /opt/pnfarm/bin/python -m compileall -q -f /opt/pnfarm/lib \
 && PYTHONHASHSEED=0 /opt/pnfarm/bin/python -m pnfarm.engine.warm \
 && rm -rf /opt/pnfarm/lib/python3*/site-packages/pnfarm/machine_code


FROM ${BASE}
LABEL org.opencontainers.image.title="pnfarm" \
      org.opencontainers.image.description="A farm of virtual servo drives that a real PLC can run" \
      org.opencontainers.image.licenses="GPL-2.0-or-later"
# Programs that run with more rights than their caller's have no use here: nobody logs in.  Logs and caches of the
# installation differ in each build.  The time of the commit, if given, is the day on which the user was made.
ARG SOURCE_DATE_EPOCH
RUN apt-get update \
 && apt-get install -y --no-install-recommends python3 \
 && rm -rf /var/lib/apt/lists/* \
 && find /var/cache /var/log -type f -delete \
 && find / -xdev -type f -perm /6000 -exec chmod ug-s {} + \
 && groupadd --system --gid 8702 pnfarm \
 && useradd --system --uid 8702 --gid pnfarm --home-dir /var/lib/pnfarm --shell /usr/sbin/nologin pnfarm \
 && mkdir /rig \
 && install -d -o pnfarm -g pnfarm -m 0750 /var/lib/pnfarm \
 && install -d -o pnfarm -g pnfarm -m 2750 /run/pnfarm
COPY --from=build /opt/pnfarm /opt/pnfarm
COPY docker /usr/local/bin
COPY configs /rig/configs
ENV PATH=/opt/pnfarm/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/opt/pnfarm/cache
WORKDIR /rig
VOLUME /var/lib/pnfarm
EXPOSE 8702
STOPSIGNAL SIGTERM
# Healthy if the farm's engine ticks.  Containers of the other commands have no API: switch it off for them (`--no-healthcheck`).
HEALTHCHECK --interval=5s --timeout=3s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8702/api/v1/readyz', timeout=2)"]
# The image's user is not root.  A farm needs NET_ADMIN and NET_RAW nevertheless: started as root, the entry point
# becomes `pnfarm` and keeps these two (see compose.yaml).
USER pnfarm
# last, because it differs in each build
ARG VERSION=local
ARG REVISION=
LABEL org.opencontainers.image.version="${VERSION}" org.opencontainers.image.revision="${REVISION}"
ENTRYPOINT ["pnfarm-entry", "pnfarm"]
CMD ["--help"]
