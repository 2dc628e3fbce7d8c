# The farm, its controller and its command line in one image.  `docker build -t pnfarm .`
#
# Builds with BuildKit and with the classic builder alike.  Behind a proxy with a certificate authority of its own:
# `--build-arg PIP_CERT=<path in the base image>`, `--build-arg PIP_INDEX_URL=...`; neither stays in the image.

ARG BASE=debian:bookworm-slim

FROM ${BASE} AS build
ARG PIP_CERT
ARG PIP_INDEX_URL
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates python3 python3-venv \
 && rm -rf /var/lib/apt/lists/*

# What pnfarm depends on changes seldom: a layer of its own, made from pyproject.toml alone.
WORKDIR /src
COPY pyproject.toml ./
RUN python3 -m venv /opt/pnfarm \
 && python3 -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies'], sep='\n')" \
      > /tmp/requirements.txt \
 && /opt/pnfarm/bin/pip install --no-cache-dir --disable-pip-version-check -r /tmp/requirements.txt

COPY README.md LICENSE ./
COPY pnfarm pnfarm
RUN /opt/pnfarm/bin/pip wheel --no-cache-dir --disable-pip-version-check --no-deps --wheel-dir /wheels . \
 && /opt/pnfarm/bin/pip install --no-cache-dir --disable-pip-version-check --no-deps /wheels/*.whl \
 && /opt/pnfarm/bin/pip uninstall -y --disable-pip-version-check setuptools pip

# The engine's machine code, made once, for any processor of this architecture.  Numba tells stale code by a file's time,
# which a layer may round: whole seconds survive.  The folders take new files from any user, as /tmp does, and keep
# what is there from being replaced.
ENV NUMBA_CACHE_DIR=/opt/pnfarm/cache NUMBA_CPU_NAME=generic
# not in /src: what is compiled must be what was installed
WORKDIR /
RUN find /opt/pnfarm/lib -name '*.py' -exec touch --no-create --date=@1700000000 {} + \
 && /opt/pnfarm/bin/python -m compileall -q -f /opt/pnfarm/lib \
 && /opt/pnfarm/bin/python -m pnfarm.engine.warm \
 && find /opt/pnfarm/cache -type d -exec chmod 1777 {} +


FROM ${BASE}
LABEL org.opencontainers.image.title="pnfarm" \
      org.opencontainers.image.description="A farm of virtual servo drives that a real PLC can run" \
      org.opencontainers.image.licenses="GPL-2.0-or-later"
RUN apt-get update \
 && apt-get install -y --no-install-recommends python3 \
 && rm -rf /var/lib/apt/lists/* \
 && mkdir -p /rig /var/lib/pnfarm
COPY --from=build /opt/pnfarm /opt/pnfarm
COPY configs /rig/configs
ENV PATH=/opt/pnfarm/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/opt/pnfarm/cache \
    NUMBA_CPU_NAME=generic
WORKDIR /rig
VOLUME /var/lib/pnfarm
EXPOSE 8702
STOPSIGNAL SIGTERM
# A farm's engine ticks.  Containers of the other commands have no API: switch it off for them (`--no-healthcheck`).
HEALTHCHECK --interval=5s --timeout=3s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8702/api/v1/readyz', timeout=2)"]
ENTRYPOINT ["pnfarm"]
CMD ["--help"]
