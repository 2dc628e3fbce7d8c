"""Projects in L5X, in the form that Studio 5000 writes."""

from xml.sax.saxutils import quoteattr


def attributes(**values):
    return " ".join(f"{key}={quoteattr(str(value))}" for key, value in values.items())


def data(way, element, octets):
    """The tag of a generic module's inputs or outputs."""
    kind = f"AB:ETHERNET_MODULE_{element}_{octets}Bytes:{way[0]}:0"
    member = f'<ArrayMember Name="Data" DataType="{element}" Dimensions="{octets}" Radix="Decimal"/>'
    return f'<{way}Tag><Data Format="Decorated"><Structure DataType="{kind}">{member}</Structure></Data></{way}Tag>'


def connection(inputs=10, outputs=4, *, element="INT", kind="Output", **more):
    values = {
        "Name": "Standard", "RPI": 10000, "Type": kind, "InputCxnPoint": 101, "OutputCxnPoint": 100,
        "OutputSize": outputs, "InputSize": inputs, "Unicast": "true", **more,
    }  # fmt: skip
    tags = data("Input", element, inputs) + data("Output", element, outputs)
    return (
        f"<Connection {attributes(**{key: one for key, one in values.items() if one is not None})}>{tags}</Connection>"
    )


def module(name, ip, *connections, configuration="[4,1,[0,0,0,0]]", communications="", **identity):
    values = {
        "Name": name, "CatalogNumber": "ETHERNET-MODULE", "Vendor": 1, "ProductType": 0, "ProductCode": 18,
        "Major": 1, "Minor": 1, "ParentModule": "Local", "ParentModPortId": 2, **identity,
    }  # fmt: skip
    port = f'<Port Id="2" Address={quoteattr(ip)} Type="Ethernet" Upstream="true"/>' if ip else ""
    config = f'<ConfigTag ConfigSize="0"><Data Format="L5K"><![CDATA[{configuration}]]></Data></ConfigTag>'
    return (
        f'<Module {attributes(**values)}><EKey State="Disabled"/><Ports>{port}</Ports><Communications {communications}>'
        f"{config}<Connections>{''.join(connections)}</Connections></Communications></Module>"
    )


def alias(name, target):
    return f'<Tag Name={quoteattr(name)} TagType="Alias" AliasFor={quoteattr(target)}/>'


def project(*modules, tags=()):
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes"?><RSLogix5000Content SchemaRevision="1.0">'
        f'<Controller Use="Target" Name="plc"><Modules>{"".join(modules)}</Modules><Tags>{"".join(tags)}</Tags>'
        "</Controller></RSLogix5000Content>"
    )
